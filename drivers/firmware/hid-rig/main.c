/* One-axis rig on a Teensy: the protocol core, and this board behind it. Messages come and go in raw HID reports. */
#include <core_pins.h>
#include <imxrt.h>
#include <usb_rawhid.h>

#include "board.h"
#include "quadrature.h"
#include "report.h"
#include "rig.h"

static const struct rig_description DESCRIPTION = {
    .axes = 1,
    .capabilities = RIG_HAS_HOME_SWITCH,
    .buttons = 2, /* the push button, and the TTL input */
    .host_silence_ms = HOST_SILENCE_MS,
    .nominal_rate_hz = NOMINAL_RATE_HZ,
    .firmware = {1, 1, 1},
    .model = MODEL,
    .serial = SERIAL,
    .axis = {{COUNT_PM, MAX_FORCE_UN, LOWEST_COUNTS, HIGHEST_COUNTS}},
};

/* Why the processor started; 0 once that has been dealt with. */
static uint32_t reset_cause;

static struct {
    volatile int32_t counts;
    volatile bool slipped;
    uint8_t last;
} encoder;

static uint8_t channels(void)
{
    return (uint8_t)((digitalReadFast(PIN_ENCODER_A) ? 1 : 0) | (digitalReadFast(PIN_ENCODER_B) ? 2 : 0));
}

static void edge(void)
{
    uint8_t now = channels();
    int8_t step = quadrature_step(encoder.last, now);
    encoder.last = now;
    if (step == QUADRATURE_SLIPPED) {
        encoder.slipped = true;
    } else {
        encoder.counts = encoder.counts + step;
    }
}

static uint32_t now_us(void *board)
{
    (void)board;
    return micros();
}

static int32_t position(void *board, uint8_t axis)
{
    (void)board;
    (void)axis;
    return encoder.counts;
}

static uint16_t buttons(void *board)
{
    (void)board;
    return (uint16_t)((digitalReadFast(PIN_BUTTON) ? 0 : 1) | (digitalReadFast(PIN_TTL_INPUT) ? 2 : 0));
}

static bool home_switch(void *board)
{
    (void)board;
    return !digitalReadFast(PIN_HOME_SWITCH);
}

static void turn_sync(void *board)
{
    static bool level;
    (void)board;
    level = !level;
    digitalWriteFast(PIN_SYNC_OUTPUT, level);
}

static void drive(void *board, uint8_t axis, int32_t force_un)
{
    (void)board;
    (void)axis;
    uint32_t magnitude_un = (uint32_t)(force_un < 0 ? -force_un : force_un);
    digitalWriteFast(PIN_MOTOR_DIRECTION, force_un >= 0);
    analogWrite(PIN_MOTOR_PWM, (int)(((uint64_t)magnitude_un << PWM_BITS) / MAX_FORCE_UN));
}

static bool problem(void *board, struct rig_problem *problem)
{
    (void)board;
    if (encoder.slipped) {
        *problem = (struct rig_problem){RIG_SENSOR_FAULT, 0, encoder.counts};
        return true;
    }
    if (reset_cause & SRC_SRSR_WDOG_RST_B) {
        *problem = (struct rig_problem){RIG_RESTART_FAULT, RIG_NO_AXIS, (int32_t)reset_cause};
        return true;
    }
    return false;
}

static void forget_problem(void *board, uint8_t fault)
{
    (void)board;
    if (fault == RIG_SENSOR_FAULT) {
        encoder.slipped = false;
    } else if (fault == RIG_RESTART_FAULT) {
        reset_cause = 0;
    }
}

static void send(void *board, const uint8_t *message, uint8_t length)
{
    uint8_t report[REPORT_SIZE];
    (void)board;
    report_make(message, length, report);
    usb_rawhid_send(report, 0); /* 0: a host that does not fetch its reports loses them */
}

static const struct rig_hal HAL = {now_us, position, buttons, home_switch, turn_sync, drive, problem, forget_problem, send};

static void start_pins(void)
{
    pinMode(PIN_MOTOR_DIRECTION, OUTPUT);
    analogWriteRes(PWM_BITS);
    analogWriteFrequency(PIN_MOTOR_PWM, PWM_HZ);
    analogWrite(PIN_MOTOR_PWM, 0);
    pinMode(PIN_HOME_SWITCH, INPUT_PULLUP);
    pinMode(PIN_BUTTON, INPUT_PULLUP);
    pinMode(PIN_TTL_INPUT, INPUT_PULLUP);
    pinMode(PIN_SYNC_OUTPUT, OUTPUT);
    pinMode(PIN_ENCODER_A, INPUT_PULLUP);
    pinMode(PIN_ENCODER_B, INPUT_PULLUP);
    delayMicroseconds(100); /* what the pull-ups need with a long cable */
    encoder.last = channels();
    attachInterrupt(PIN_ENCODER_A, edge, CHANGE);
    attachInterrupt(PIN_ENCODER_B, edge, CHANGE);
}

static void feed_watchdog(void)
{
    WDOG1_WSR = 0x5555;
    WDOG1_WSR = 0xAAAA;
}

/* From here on a program that hangs, or whose fault the library keeps in a loop, is reset after 0.5 s, which is the
 * shortest time of WDOG1. Reset lets go of the motor. */
static void start_watchdog(void)
{
    reset_cause = SRC_SRSR;
    SRC_SRSR = reset_cause; /* its bits are cleared by writing ones */
    CCM_CCGR3 |= CCM_CCGR3_WDOG1(CCM_CCGR_ON);
    WDOG1_WMCR = 0; /* no power-down counter */
    /* One write, since most bits can be written once. SRS and WDA are requests while they are 0. */
    WDOG1_WCR = WDOG_WCR_WT(0) | WDOG_WCR_SRS | WDOG_WCR_WDA | WDOG_WCR_WDE;
}

int main(void)
{
    static struct rig rig;
    static uint8_t report[REPORT_SIZE];

    start_pins();
    start_watchdog();
    rig_start(&rig, &DESCRIPTION, &HAL, 0);
    for (;;) {
        feed_watchdog(); /* here only: what hangs in the loop while interrupts go on has to be reset too */
        rig_work(&rig);
        if (usb_rawhid_available() <= 0 || usb_rawhid_recv(report, 0) <= 0) {
            continue;
        }
        uint8_t length = report_message(report);
        if (length == 0) {
            rig_receive_damaged(&rig);
        } else {
            rig_receive(&rig, report + 1, length);
        }
    }
}
