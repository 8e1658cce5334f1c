/* CRC-16/IBM-3740: polynomial 0x1021, start 0xFFFF, nothing reflected. */
#ifndef RIG_CRC16_H
#define RIG_CRC16_H

#include <stddef.h>
#include <stdint.h>

uint16_t crc16(const uint8_t *bytes, size_t length);

#endif
