#include "clock.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

/* Half microseconds in the timer, 128 us a turn: the sum of turns wraps where the protocol's clock does. */
enum { TURN_US = 128 };

static volatile uint32_t turns_us;

ISR(TIMER0_OVF_vect)
{
    turns_us += TURN_US;
}

void clock_start(void)
{
    TCCR0B = 1 << CS01; /* 16 MHz / 8 */
    TIMSK0 = 1 << TOIE0;
}

uint32_t clock_us(void)
{
    uint32_t us;
    uint8_t half_us;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        us = turns_us;
        half_us = TCNT0;
        if ((TIFR0 & 1 << TOV0) && half_us < 128) {
            us += TURN_US; /* turned over with the interrupt still waiting */
        }
    }
    return us + half_us / 2;
}
