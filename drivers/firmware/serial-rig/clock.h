/* Microseconds since power-up from timer 2. */
#ifndef CLOCK_H
#define CLOCK_H

#include <stdint.h>

void clock_start(void);
uint32_t clock_us(void);

#endif
