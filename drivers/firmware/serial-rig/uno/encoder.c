#include "sensor.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>
#include <util/delay.h>

#include "board.h"
#include "quadrature.h"

_Static_assert(ENCODER_A == PD2 && ENCODER_B == PD3, "the external interrupts are on these pins");

/* The interrupt at an edge has to be short: it counts in one byte, which another one empties every 128 us, long before
 * it is full. */
static volatile int8_t recent;
static volatile int32_t older;
static volatile bool slipped;
static volatile uint8_t last;

static uint8_t channels(void)
{
    return (uint8_t)(PIND >> ENCODER_A) & 3;
}

ISR(INT0_vect)
{
    uint8_t now = channels();
    int8_t step = quadrature_step(last, now);
    last = now;
    if (step == QUADRATURE_SLIPPED) {
        slipped = true;
    } else {
        recent = (int8_t)(recent + step);
    }
}

ISR(INT1_vect, ISR_ALIASOF(INT0_vect));

ISR(TIMER2_COMPA_vect)
{
    older += recent;
    recent = 0;
}

void sensor_start(void)
{
    PORTD |= 1 << ENCODER_A | 1 << ENCODER_B; /* pull-ups, for open collectors */
    _delay_us(100);                           /* and the time that they need with a long cable */
    EICRA = 1 << ISC00 | 1 << ISC10;          /* every edge */
    EIFR = 1 << INTF0 | 1 << INTF1;
    last = channels();
    EIMSK = 1 << INT0 | 1 << INT1;
    TIMSK2 |= 1 << OCIE2A; /* of the clock's timer, which turns over every 128 us */
}

int32_t sensor_counts(void)
{
    int32_t now;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        now = older + recent;
    }
    return now;
}

bool sensor_slipped(void)
{
    return slipped;
}

void sensor_forget(void)
{
    slipped = false;
}
