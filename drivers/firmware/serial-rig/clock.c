#include "clock.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

/* Half microseconds in the timer, 128 us a turn: the sum of turns wraps where the protocol's clock does. */
enum { TURN_US = 128 };

static volatile uint32_t turns_us;

ISR(TIMER2_OVF_vect)
{
    turns_us += TURN_US;
}

void clock_start(void)
{
    TCCR2B = 1 << CS21; /* 16 MHz / 8 */
    TIMSK2 = 1 << TOIE2;
}

uint32_t clock_us(void)
{
    uint32_t us;
    uint8_t half_us;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        us = turns_us;
        half_us = TCNT2;
        if ((TIFR2 & 1 << TOV2) && half_us < 128) {
            us += TURN_US; /* turned over with the interrupt still waiting */
        }
    }
    return us + half_us / 2;
}
