#include "motor.h"

#include <avr/io.h>

#include "board.h"

/* Timer 0 counts 256 clocks: 62.5 kHz, at which the motor's law was measured. */
enum { STEPS = 256, SHIFT = 15 };

/* STEPS^2 at full force; with as many binary places as fit. */
#define PER_UN (((uint32_t)STEPS * STEPS << SHIFT) / MAX_FORCE_UN)

/* Rounded to the nearest, of at most STEPS^2. */
static uint16_t square_root(uint32_t square)
{
    if (square > 65280) { /* 255.5^2 */
        return STEPS;
    }
    uint16_t value = (uint16_t)square;
    uint8_t root = 0;
    for (uint8_t bit = 128; bit != 0; bit >>= 1) {
        uint8_t trial = root | bit;
        if ((uint16_t)trial * trial <= value) {
            root = trial;
        }
    }
    uint16_t below = (uint16_t)root * root;
    return value - below > root ? (uint16_t)(root + 1) : root;
}

void motor_start(void)
{
    PORTD &= (uint8_t)~(1 << MOTOR_PWM);
    DDRD |= 1 << MOTOR_PWM;
    DDRB |= 1 << MOTOR_DIRECTION;
    TCCR0A = 1 << WGM01 | 1 << WGM00; /* fast PWM, its output not yet connected */
    TCCR0B = 1 << CS00;
}

/* force = full force * duty^2 */
void motor_drive(int32_t force_un)
{
    uint32_t magnitude_un = (uint32_t)(force_un < 0 ? -force_un : force_un);
    uint16_t steps = square_root(magnitude_un * PER_UN >> SHIFT);
    if (force_un < 0) {
        PORTB &= (uint8_t)~(1 << MOTOR_DIRECTION);
    } else {
        PORTB |= 1 << MOTOR_DIRECTION;
    }
    if (steps == 0) { /* the timer's own 0 is a pulse of one clock: the pin is low instead */
        TCCR0A &= (uint8_t)~(1 << COM0B1);
        return;
    }
    OCR0B = (uint8_t)(steps - 1);
    TCCR0A |= 1 << COM0B1;
}
