/* Magnetoresistive angle sensor: a voltage that rises over half a turn of the magnet and falls back where the next one
 * begins. Half turns are counted in an interrupt at each conversion, every 104 us. */
#include "sensor.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

#include "board.h"

enum {
    SPAN = HIGHEST_RAW - LOWEST_RAW,
    MOST_STEP = 40, /* between two conversions: 5.6 m/s at the handle, faster than any hand */
    MOST_MISSED = 7,
    NODE_SHIFT = 6, /* a node of the table every 64 readings */
};
_Static_assert((MOST_MISSED + 1) * MOST_STEP < SPAN / 2, "which way it went would not be clear");

static const int16_t table[(1024 >> NODE_SHIFT) + 1] = TABLE;

static volatile int16_t believed;  /* the last reading that made sense */
static volatile int16_t half_turns;
static volatile uint8_t missed;    /* readings since then, at most MOST_MISSED */
static volatile bool slipped;

/* A conversion that falls into the jump shows anything between both ends: it is passed over, as is any that is further
 * from the last than a hand moves. Many in a row are a fault: how far the handle has gone is then unknown. */
ISR(ADC_vect)
{
    int16_t raw = (int16_t)ADC;
    int16_t step = (int16_t)(raw - believed);
    int8_t jump = 0;
    if (step > SPAN / 2) {
        step -= SPAN;
        jump = -1;
    } else if (step < -(SPAN / 2)) {
        step += SPAN;
        jump = 1;
    }
    int16_t most = (int16_t)((missed + 1) * MOST_STEP);
    bool alive = raw >= ALIVE_FROM_RAW && raw <= ALIVE_TO_RAW;
    bool lost = missed == MOST_MISSED;
    if (alive && (lost || (step <= most && step >= -most))) {
        believed = raw;
        half_turns += jump;
        missed = 0;
    } else if (!lost) {
        missed++;
    }
    slipped = slipped || missed == MOST_MISSED;
}

void sensor_start(void)
{
    PORTC |= 1 << SENSOR_CHANNEL; /* the pull-up shows a broken wire, and moves a sensor that drives its output little */
    DIDR0 = 1 << SENSOR_CHANNEL;
    ADMUX = 1 << REFS0 | SENSOR_CHANNEL; /* the supply is the reference, as it is the sensor's */
    ADCSRB = 0;                          /* each conversion starts the next one */
    ADCSRA = 1 << ADEN | 1 << ADSC | 1 << ADPS2 | 1 << ADPS1 | 1 << ADPS0; /* 125 kHz, 13 cycles each */
    while (ADCSRA & 1 << ADSC) {
    }
    believed = (int16_t)ADC;
    ADCSRA |= 1 << ADATE | 1 << ADIF | 1 << ADIE | 1 << ADSC;
}

int32_t sensor_counts(void)
{
    int16_t raw, turns;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        raw = believed;
        turns = half_turns;
    }
    uint8_t node = (uint8_t)(raw >> NODE_SHIFT);
    int16_t beyond = raw & ((1 << NODE_SHIFT) - 1);
    int16_t counts = (int16_t)(table[node] + (beyond * (table[node + 1] - table[node]) >> NODE_SHIFT));
    return (int32_t)turns * HALF_TURN_COUNTS + counts;
}

bool sensor_slipped(void)
{
    return slipped;
}

void sensor_forget(void)
{
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        slipped = missed == MOST_MISSED;
    }
}
