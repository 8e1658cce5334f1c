/* What is fastened to the pins of a board, as drivers/firmware/serial-rig has it for each. */
#ifndef WIRING_H
#define WIRING_H

#include <stdint.h>

#include "handle.h"

/* Data addresses (ATmega328P data sheet, register summary). */
enum {
    DDRB = 0x24,
    PORTB = 0x25,
    DDRC = 0x27,
    PORTC = 0x28,
    DDRD = 0x2a,
    PORTD = 0x2b,
    TCCR0A = 0x44,
    TCCR0B = 0x45,
    OCR0B = 0x48,
    TCCR1A = 0x80,
    TCCR1B = 0x81,
    ICR1L = 0x86,
    OCR1AL = 0x88,
};

struct wiring {
    const char *name;
    struct handle handle; /* at rest in the middle */
    uint8_t outside;      /* pins of port D that something outside drives */
    uint8_t sync_pin;     /* of port D */

    /* Levels of those pins. */
    uint8_t (*levels)(struct handle *handle);

    /* What the bridge makes of its pins [N]: nothing at all unless the timer really drives them. `data` is the memory of
     * the processor. */
    double (*motor_n)(const uint8_t *data);

    /* Voltage at the analog input 2 [mV], after some time has passed [s]; NULL where nothing is fastened there. */
    double (*millivolts)(struct handle *handle, const uint8_t *data, double dt_s);
};

extern const struct wiring UNO, HAPKIT;

#endif
