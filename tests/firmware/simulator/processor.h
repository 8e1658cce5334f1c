/* An ATmega328P at 16 MHz that runs the firmware, with the handle at its pins and bytes at its UART. */
#ifndef PROCESSOR_H
#define PROCESSOR_H

#include <stdbool.h>
#include <stdint.h>

#include "handle.h"
#include "wiring.h"

struct processor;

/* Load the firmware. Ends the program when it is none. */
struct processor *processor_new(const char *firmware, const struct wiring *wiring, struct handle *handle);

void processor_switch_on(struct processor *processor);
void processor_switch_off(struct processor *processor);
bool processor_is_on(const struct processor *processor);

/* Run for a microsecond or an instruction longer, and let the handle move. Returns how long it was [us]. */
double processor_run(struct processor *processor);

/* Whether the UART takes a byte now: one each 10 us, which is 1 Mbaud. */
bool processor_listens(const struct processor *processor);
void processor_hear(struct processor *processor, uint8_t byte);

/* The next byte that the UART has sent; -1: none. */
int processor_said(struct processor *processor);

/* Send the program into a loop that never looks at the processor's watchdog. */
void processor_hang(struct processor *processor);

/* How often it has reset itself since it was switched on. */
unsigned processor_resets(const struct processor *processor);

/* How often its sync output has turned since it was switched on; looked at every microsecond. */
unsigned processor_syncs(const struct processor *processor);

#endif
