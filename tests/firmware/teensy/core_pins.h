/* What hid-rig uses of the Teensy core library's pins, declared for a check without that library. */
#ifndef CORE_PINS_H
#define CORE_PINS_H

#include <stdint.h>

#define OUTPUT 1
#define INPUT_PULLUP 2
#define CHANGE 4

uint32_t micros(void);
void delayMicroseconds(uint32_t us);
void pinMode(uint8_t pin, uint8_t mode);
uint8_t digitalReadFast(uint8_t pin);
void digitalWriteFast(uint8_t pin, uint8_t value);
void analogWrite(uint8_t pin, int value);
uint32_t analogWriteRes(uint32_t bits);
void analogWriteFrequency(uint8_t pin, float frequency);
void attachInterrupt(uint8_t pin, void (*function)(void), int mode);

#endif
