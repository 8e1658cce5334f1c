/* A Teensy of pipes: hid-rig's main() runs on the host. Each line on stdin is what happens to it:
 *
 *   report BYTES      a report comes (hexadecimal); what the rig sends is printed as `report BYTES`
 *   edge PIN LEVEL    a pin changes
 *   slip              both channels of the encoder change between two interrupts
 *   time US           time passes
 *   sync              prints the level of the sync output: `sync LEVEL`
 *   motor             prints what the motor's pins do: `motor DIRECTION DUTY`
 *   watchdog          prints how it was set, and what was written to feed it since the last line: `watchdog WCR WSR...`
 *   causes            prints the reset causes that were written back: `causes SRSR`
 *
 * The environment's RESET_CAUSE is what the reset cause register says at the start.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core_pins.h"
#include "imxrt.h"
#include "usb_rawhid.h"

enum { PINS = 10, REPORT = 64, FEEDS = 16, CAUSES = 2 };

static uint32_t now_us;
static uint8_t level[PINS] = {[6] = 1, [7] = 1};
static int duty[PINS];
static void (*handler[PINS])(void);
static uint8_t report[REPORT];
static int waiting;

volatile uint32_t CCM_CCGR3;
volatile uint16_t WDOG1_WCR, WDOG1_WMCR = 1;
static volatile uint16_t fed[FEEDS];
static unsigned feeds, feeds_before;
static volatile uint32_t causes[CAUSES];
static unsigned looks_at_causes;

volatile uint16_t *next_wsr(void)
{
    if (feeds == FEEDS) {
        fputs("the watchdog is fed without end\n", stderr);
        exit(1);
    }
    return &fed[feeds++];
}

/* It is read first, and then written. */
volatile uint32_t *srsr(void)
{
    const char *cause = getenv("RESET_CAUSE");
    if (looks_at_causes == 0 && cause != NULL) {
        causes[0] = (uint32_t)strtoul(cause, NULL, 0);
    }
    return &causes[looks_at_causes++ % CAUSES];
}

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
    } else if (strncmp(line, "sync", 4) == 0) {
        printf("sync %u\n", level[9]);
    } else if (strncmp(line, "watchdog", 8) == 0) {
        printf("watchdog %04x", CCM_CCGR3 & 3u << 16 && WDOG1_WMCR == 0 ? WDOG1_WCR : 0);
        for (unsigned i = 0; i < feeds_before; i++) {
            printf(" %04x", fed[i]);
        }
        printf("\n");
    } else if (strncmp(line, "causes", 6) == 0) {
        printf("causes %x\n", causes[1]);
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
        feeds_before = feeds;
        feeds = 0;
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
