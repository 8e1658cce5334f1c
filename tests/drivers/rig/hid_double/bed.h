/* A hidraw node of umockdev: a process that runs with its preload library finds it, opens it, reads and writes it.
 *
 * The node is a pseudo-terminal, so that poll() and a blocked write() are the kernel's. What a terminal has not, and
 * hidraw has, is made here: reports keep their bounds, the input queue holds 63 and then drops, and whoever opens the
 * node finds it empty. */
#ifndef BED_H
#define BED_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "report_descriptor.h"

enum { OUTPUT_REPORT = REPORT + 1 /* the report number goes before it */ };

struct bed;

struct bed *bed_new(void);
void bed_free(struct bed *bed); /* unplugs it and removes the testbed's directory */

const char *bed_directory(const struct bed *bed); /* UMOCKDEV_DIR of the clients */

void bed_plug(struct bed *bed, const char *serial);
void bed_unplug(struct bed *bed);

/* To be polled for input; -1 while there is nothing to come. */
int bed_descriptor(const struct bed *bed);

/* The next report that a client has written, with its number; false when there is none. */
bool bed_receive(struct bed *bed, uint8_t report[OUTPUT_REPORT]);

/* A report of any length for the clients; it is cut to what their read() asks for, 64 bytes, as hidraw does. */
void bed_send(struct bed *bed, const uint8_t *report, size_t length);

/* Let the clients have what has been sent, as far as its bounds can be kept; to be called all the time. */
void bed_work(struct bed *bed);

/* From now on a write() blocks ... until now. */
void bed_hold(struct bed *bed);
void bed_release(struct bed *bed);

#endif
