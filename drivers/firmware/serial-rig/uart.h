/* The serial line, both ways through rings that interrupts fill and empty. */
#ifndef UART_H
#define UART_H

#include <stdbool.h>
#include <stdint.h>

void uart_start(void);

/* The next byte that has come, or -1. */
int16_t uart_read(void);

/* Queue all bytes; false, and none of them, when there is no room. */
bool uart_write(const uint8_t *bytes, uint8_t length);

#endif
