/* The protocol core on the host, with a board of plain variables: for tests of drivers and of the core itself.
 *
 * Time stands still but for host_rig_clock(). One transport a rig: bytes of a line, or reports. */
#ifndef HOST_RIG_H
#define HOST_RIG_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "hal.h"

struct host_rig;

/* The rig that sessions.txt is about, with 1 to 3 equal axes. NULL without memory or with another number of axes. */
struct host_rig *host_rig_new(uint8_t axes);
void host_rig_free(struct host_rig *host);

/* The description, to be changed before the first message; it is read at every use. */
struct rig_description *host_rig_description(struct host_rig *host);

/* Set the clock [us] and let the rig work. */
void host_rig_clock(struct host_rig *host, uint32_t now_us);

/* Set the clock [us] as if the board had been too busy to work meanwhile. */
void host_rig_stall(struct host_rig *host, uint32_t now_us);

void host_rig_set_position(struct host_rig *host, uint8_t axis, int32_t counts);
void host_rig_set_buttons(struct host_rig *host, uint16_t bits);
void host_rig_set_home_switch(struct host_rig *host, bool closed);

/* Let something go wrong, one thing at a time; it is seen at the next work, and lasts until the cause is gone. A slip of
 * the sensor is remembered until the rig forgets it, as an interrupt's is. */
void host_rig_break(struct host_rig *host, uint8_t fault, uint8_t axis, int32_t detail);
void host_rig_mend(struct host_rig *host);

/* Let the sensor slip while the motor is next told something: in the midst of the rig's work. */
void host_rig_slip_when_driven(struct host_rig *host);

/* What the motor of an axis is told [uN]. */
int32_t host_rig_force(const struct host_rig *host, uint8_t axis);

/* How often its sync output has turned. */
uint32_t host_rig_syncs(const struct host_rig *host);

/* Switch it off and on again: everything but the board's variables is forgotten. */
void host_rig_restart(struct host_rig *host);

/* A line: bytes to the rig; bytes from it, at most `size`, returns how many. */
void host_rig_write(struct host_rig *host, const uint8_t *bytes, size_t length);
size_t host_rig_read(struct host_rig *host, uint8_t *bytes, size_t size);

/* Reports: one of any length to the rig; the oldest one from it, 64 bytes, false when there is none. */
void host_rig_write_report(struct host_rig *host, const uint8_t *report, size_t length);
bool host_rig_read_report(struct host_rig *host, uint8_t *report);

/* The oldest message that the rig has sent, at most 63 bytes; 0 when there is none. */
uint8_t host_rig_read_message(struct host_rig *host, uint8_t *message);

#endif
