/* What hid-rig takes from the Teensy core library, as symbols to link with: it does nothing. */
#include <core_pins.h>
#include <imxrt.h>
#include <string.h>
#include <usb_rawhid.h>

volatile uint32_t CCM_CCGR3;
volatile uint16_t WDOG1_WCR, WDOG1_WMCR;
static volatile uint16_t wsr;
static volatile uint32_t causes;

volatile uint16_t *next_wsr(void) { return &wsr; }
volatile uint32_t *srsr(void) { return &causes; }

uint32_t micros(void) { return 0; }
void delayMicroseconds(uint32_t us) { (void)us; }
void pinMode(uint8_t pin, uint8_t mode) { (void)pin, (void)mode; }
uint8_t digitalReadFast(uint8_t pin) { return pin; }
void digitalWriteFast(uint8_t pin, uint8_t value) { (void)pin, (void)value; }
void analogWrite(uint8_t pin, int value) { (void)pin, (void)value; }
uint32_t analogWriteRes(uint32_t bits) { return bits; }
void analogWriteFrequency(uint8_t pin, float frequency) { (void)pin, (void)frequency; }
void attachInterrupt(uint8_t pin, void (*function)(void), int mode) { (void)pin, (void)function, (void)mode; }

int usb_rawhid_available(void) { return 0; }
int usb_rawhid_recv(void *buffer, uint32_t timeout) { return buffer != 0 && timeout != 0; }
int usb_rawhid_send(const void *buffer, uint32_t timeout) { return buffer != 0 && timeout != 0; }

/* Division of 64-bit numbers, by which the compiler calls it. */
void __aeabi_uldivmod(void);
void __aeabi_uldivmod(void) {}

void *memcpy(void *to, const void *from, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        ((volatile char *)to)[i] = ((const char *)from)[i];
    }
    return to;
}

void *memset(void *at, int value, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        ((volatile char *)at)[i] = (char)value;
    }
    return at;
}
