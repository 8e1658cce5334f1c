/* The serial line: a pty, and a symbolic link to it that is there while the rig is plugged in. */
#ifndef LINE_H
#define LINE_H

#include <stdbool.h>
#include <stdint.h>

void line_plug(const char *link);
void line_unplug(void);

/* The side of the rig; -1 while it is unplugged. */
int line_descriptor(void);

/* Take what the host has written, as far as there is room. */
void line_take(void);
bool line_has_room(void);

/* Let the rig hear what has been taken, as far as the end of the next frame, or all of it. */
void line_let_frame(void);
void line_let_all(void);

/* The next byte that it may hear; -1: none. */
int line_next(void);

/* Queue a byte of the rig, and give to the host what is queued. */
void line_put(uint8_t byte);
void line_give(void);

/* Bytes taken and given since it was plugged in. */
unsigned long line_taken(void);
unsigned long line_given(void);

/* How many frames (zeros) have been taken since the last call. */
unsigned long line_frames(void);

#endif
