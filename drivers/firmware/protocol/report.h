/* Messages in 64-byte raw HID reports: the length, the message, zeros. */
#ifndef RIG_REPORT_H
#define RIG_REPORT_H

#include <stdint.h>

#include "message.h"

enum { REPORT_SIZE = RIG_MESSAGE_MAX + 1 };

/* Fill all REPORT_SIZE bytes of a report. */
void report_make(const uint8_t *message, uint8_t length, uint8_t *report);

/* Length of the message that begins at report[1]; 0 when the length byte makes no sense. */
uint8_t report_message(const uint8_t *report);

#endif
