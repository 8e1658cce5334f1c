/* One-axis rig on an ATmega328P: the protocol core, and behind it the board in whose folder `board.h` is. */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/wdt.h>

#include "board.h"
#include "clock.h"
#include "frame.h"
#include "motor.h"
#include "rig.h"
#include "sensor.h"
#include "uart.h"

static const struct rig_description DESCRIPTION = {
    .axes = 1,
#ifdef HOME_SWITCH
    .capabilities = RIG_HAS_HOME_SWITCH,
#endif
    .buttons = 2, /* the push button, and the TTL input */
    .host_silence_ms = HOST_SILENCE_MS,
    .nominal_rate_hz = NOMINAL_RATE_HZ,
    .firmware = {1, 2, 1},
    .model = MODEL,
    .serial = SERIAL,
    .axis = {{COUNT_PM, MAX_FORCE_UN, LOWEST_COUNTS, HIGHEST_COUNTS}},
};

/* Why the processor started; 0 once that has been dealt with. */
static uint8_t reset_cause __attribute__((section(".noinit")));

/* Before main(): after a reset by the watchdog it is still running, with its shortest time. */
void save_reset_cause(void) __attribute__((naked, used, section(".init3")));
void save_reset_cause(void)
{
    reset_cause = MCUSR;
    MCUSR = 0;
    wdt_disable();
}

static uint32_t micros(void *board)
{
    (void)board;
    return clock_us();
}

static int32_t position(void *board, uint8_t axis)
{
    (void)board;
    (void)axis;
    return sensor_counts();
}

static uint16_t buttons(void *board)
{
    (void)board;
    return (uint16_t)((PIND & 1 << BUTTON ? 0 : 1) | (PIND & 1 << TTL_INPUT ? 2 : 0));
}

static bool home_switch(void *board)
{
    (void)board;
#ifdef HOME_SWITCH
    return !(PIND & 1 << HOME_SWITCH);
#else
    return false;
#endif
}

static void turn_sync(void *board)
{
    (void)board;
    PIND = 1 << SYNC_OUTPUT; /* writing a one there turns the pin */
}

static void drive(void *board, uint8_t axis, int32_t force_un)
{
    (void)board;
    (void)axis;
    motor_drive(force_un);
}

static bool problem(void *board, struct rig_problem *problem)
{
    (void)board;
    problem->axis = 0;
    if (sensor_slipped()) {
        problem->fault = RIG_SENSOR_FAULT;
        problem->detail = sensor_counts();
        return true;
    }
    bool switched_on = reset_cause & 1 << PORF; /* brown-out may be set as well while the supply rises */
    if (!switched_on && (reset_cause & (1 << WDRF | 1 << BORF))) {
        problem->fault = RIG_RESTART_FAULT;
        problem->axis = RIG_NO_AXIS;
        problem->detail = reset_cause;
        return true;
    }
    return false;
}

static void forget_problem(void *board, uint8_t fault)
{
    (void)board;
    if (fault == RIG_SENSOR_FAULT) {
        sensor_forget();
    } else if (fault == RIG_RESTART_FAULT) {
        reset_cause = 0;
    }
}

static void send(void *board, const uint8_t *message, uint8_t length)
{
    uint8_t frame[FRAME_MAX];
    (void)board;
    uart_write(frame, frame_make(message, length, frame));
}

static const struct rig_hal HAL = {micros, position, buttons, home_switch, turn_sync, drive, problem, forget_problem, send};

/* What is due is looked at when the line is quiet, and on a line that never is, every 32 bytes: 0.32 ms at 1 Mbaud.
 * At every byte it would cost more than the time between two. */
enum { BYTES_AT_ONCE = 32 };

int main(void)
{
    static struct rig rig;
    static struct frame_receiver receiver;
    uint8_t at_once = 0;

    motor_start(); /* first of all: the pins are driven low */
    PORTD |= 1 << BUTTON | 1 << TTL_INPUT;
#ifdef HOME_SWITCH
    PORTD |= 1 << HOME_SWITCH;
#endif
    DDRD |= 1 << SYNC_OUTPUT;
    clock_start();
    sensor_start();
    uart_start();
    wdt_enable(WDTO_15MS); /* a program that hangs resets the processor, and reset lets go of the motor */
    sei();
    rig_start(&rig, &DESCRIPTION, &HAL, 0);

    for (;;) {
        int16_t byte = uart_read();
        wdt_reset();
        if (byte < 0 || ++at_once == BYTES_AT_ONCE) {
            at_once = 0;
            rig_work(&rig);
        }
        if (byte < 0) {
            continue;
        }
        enum frame_event event = frame_receive(&receiver, (uint8_t)byte);
        if (event == FRAME_MESSAGE) {
            rig_receive(&rig, receiver.bytes, receiver.length);
        } else if (event == FRAME_DAMAGED) {
            rig_receive_damaged(&rig);
        }
    }
}
