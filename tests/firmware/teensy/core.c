/* A Teensy of pipes: hid-rig's main() runs on the host. Each line on stdin is what happens to it:
 *
 *   report BYTES      a report comes (hexadecimal); what the rig sends is printed as `report BYTES`
 *   edge PIN LEVEL    a pin changes
 *   slip              both channels of the encoder change between two interrupts
 *   time US           time passes
 *   motor             prints what the motor's pins do: `motor DIRECTION DUTY`
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core_pins.h"
#include "usb_rawhid.h"

enum { PINS = 8, REPORT = 64 };

static uint32_t now_us;
static uint8_t level[PINS] = {[6] = 1, [7] = 1};
static int duty[PINS];
static void (*handler[PINS])(void);
static uint8_t report[REPORT];
static int waiting;

uint32_t micros(void) { return now_us; }
void delayMicroseconds(uint32_t us) { now_us += us; }
void pinMode(uint8_t pin, uint8_t mode) { (void)pin, (void)mode; }
uint8_t digitalReadFast(uint8_t pin) { return level[pin]; }
void digitalWriteFast(uint8_t pin, uint8_t value) { level[pin] = value; }
void analogWrite(uint8_t pin, int value) { duty[pin] = value; }
uint32_t analogWriteRes(uint32_t bits) { return bits; }
void analogWriteFrequency(uint8_t pin, float frequency) { (void)pin, (void)frequency; }
void attachInterrupt(uint8_t pin, void (*function)(void), int mode) { (void)mode, handler[pin] = function; }

static void obey(const char *line)
{
    unsigned pin, value;
    if (sscanf(line, "edge %u %u", &pin, &value) == 2 && pin < PINS) {
        level[pin] = (uint8_t)value;
        if (handler[pin] != NULL) {
            handler[pin]();
        }
    } else if (strncmp(line, "slip", 4) == 0) {
        level[2] = !level[2];
        level[3] = !level[3];
        handler[3]();
    } else if (sscanf(line, "time %u", &value) == 1) {
        now_us += value;
    } else if (strncmp(line, "motor", 5) == 0) {
        printf("motor %u %d\n", level[5], duty[4]);
    } else if (strncmp(line, "report ", 7) == 0) {
        for (int i = 0; i < REPORT && sscanf(line + 7 + 2 * i, "%2x", &value) == 1; i++) {
            report[i] = (uint8_t)value;
        }
        waiting = REPORT;
    }
}

/* The main loop asks once a turn: the moment for the next line. */
int usb_rawhid_available(void)
{
    static char line[256];
    if (!waiting) {
        if (fgets(line, sizeof line, stdin) == NULL) {
            exit(0);
        }
        obey(line);
    }
    return waiting;
}

int usb_rawhid_recv(void *buffer, uint32_t timeout)
{
    (void)timeout;
    memcpy(buffer, report, REPORT);
    waiting = 0;
    return REPORT;
}

int usb_rawhid_send(const void *buffer, uint32_t timeout)
{
    const uint8_t *bytes = buffer;
    (void)timeout;
    printf("report ");
    for (int i = 0; i < REPORT; i++) {
        printf("%02x", bytes[i]);
    }
    printf("\n");
    return REPORT;
}
