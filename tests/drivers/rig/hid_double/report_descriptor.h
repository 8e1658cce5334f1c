/* What the rig's reports are, as the rig tells it. */
#ifndef REPORT_DESCRIPTOR_H
#define REPORT_DESCRIPTOR_H

#include <stdint.h>

enum { VENDOR = 0x16c0, PRODUCT = 0x0486, REPORT = 64 };

static const uint8_t REPORT_DESCRIPTOR[] = {
    0x06, 0xab, 0xff,                   /* usage page 0xffab */
    0x0a, 0x00, 0x02,                   /* usage 0x0200 */
    0xa1, 0x01,                         /* collection */
    0x75, 0x08, 0x15, 0x00,             /* 8 bits, from 0 */
    0x26, 0xff, 0x00,                   /* to 255 */
    0x95, 0x40, 0x09, 0x01, 0x81, 0x02, /* 64 in */
    0x95, 0x40, 0x09, 0x02, 0x91, 0x02, /* 64 out */
    0xc0,
};

#endif
