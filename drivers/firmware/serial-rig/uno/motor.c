#include "motor.h"

#include <avr/io.h>

#include "board.h"

/* Timer 1 counts up to TOP and down again: 16 MHz / (2 * 400) = 20 kHz, and a duty of 0 is a pin that stays low. */
enum { TOP = 400 };

#define UN_PER_STEP (MAX_FORCE_UN / TOP)

void motor_start(void)
{
    ICR1 = TOP;
    OCR1A = 0;
    TCCR1A = 1 << COM1A1 | 1 << WGM11; /* phase correct, top in ICR1, PWM on OC1A = PB1 */
    TCCR1B = 1 << WGM13 | 1 << CS10;
    DDRB |= 1 << MOTOR_PWM | 1 << MOTOR_DIRECTION;
}

void motor_drive(int32_t force_un)
{
    uint32_t magnitude_un = (uint32_t)(force_un < 0 ? -force_un : force_un);
    uint16_t steps = (uint16_t)((magnitude_un + UN_PER_STEP / 2) / UN_PER_STEP);
    /* The timer takes the new duty at its next top, up to 50 us after the direction has changed. */
    if (force_un < 0) {
        PORTB &= (uint8_t)~(1 << MOTOR_DIRECTION);
    } else {
        PORTB |= 1 << MOTOR_DIRECTION;
    }
    OCR1A = steps > TOP ? TOP : steps;
}
