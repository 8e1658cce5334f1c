#include "report.h"

#include <string.h>

void report_make(const uint8_t *message, uint8_t length, uint8_t *report)
{
    memset(report, 0, REPORT_SIZE);
    report[0] = length;
    memcpy(report + 1, message, length);
}

uint8_t report_message(const uint8_t *report)
{
    return report[0] >= RIG_MESSAGE_MIN && report[0] <= RIG_MESSAGE_MAX ? report[0] : 0;
}
