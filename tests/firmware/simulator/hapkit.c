#include <math.h>

#include "wiring.h"

enum { PIN_DIRECTION = 0 };                                      /* of port B */
enum { PIN_SENSOR = 2 };                                         /* of port C */
enum { PIN_BUTTON = 2, PIN_TTL = 3, PIN_SYNC = 4, PIN_PWM = 5 }; /* of port D */

static const double PI = 3.14159265358979323846;

/* The magnet turns 74 mm / (70 mm * 5 mm) times as far as the handle goes; the sensor sees each half of a turn alike. */
#define RAD_PER_M (0.074 / (0.070 * 0.005))
static const double FULL_TORQUE_NM = 14.6e-3; /* at a duty of 1 */

static const double SUPPLY_MV = 5000.0;
static const double LOWEST_MV = 15.5 / 1024 * 5000.0, HIGHEST_MV = 980.5 / 1024 * 5000.0;
static const double FILTER_S = 30e-6; /* of its output: the jump takes about as long as a conversion */

static uint8_t levels(struct handle *handle)
{
    handle->shown = lrint(handle->position_m * handle->counts_per_m) - handle->offset;
    return (uint8_t)((unsigned)!handle->button << PIN_BUTTON | (unsigned)handle->ttl << PIN_TTL);
}

/* The public law of this motor: the torque grows with the square of the duty. */
static double motor_n(const uint8_t *data)
{
    bool fast = (data[TCCR0A] & 3) == 3 && (data[TCCR0B] & 0x0f) == 1;
    bool driven = data[DDRD] >> PIN_PWM & 1 && data[DDRB] >> PIN_DIRECTION & 1;
    double duty = data[PORTD] >> PIN_PWM & 1; /* a pin that the timer does not have */
    if ((data[TCCR0A] & 0x30) == 0x20) {
        duty = fast ? (data[OCR0B] + 1) / 256.0 : 1.0;
    }
    double force_n = driven ? duty * duty * FULL_TORQUE_NM * RAD_PER_M : 0.0;
    return data[PORTB] >> PIN_DIRECTION & 1 ? force_n : -force_n;
}

static double millivolts(struct handle *handle, const uint8_t *data, double dt_s)
{
    double half_turns = handle->position_m * RAD_PER_M / PI - (double)handle->offset / 1024;
    double share = half_turns - floor(half_turns) + 0.5; /* switched on in the middle of a half turn */
    share -= floor(share);
    share += handle->bend * sin(2.0 * PI * share) / (2.0 * PI);
    double shown_mv = LOWEST_MV + share * (HIGHEST_MV - LOWEST_MV);
    if (handle->broken_wire) { /* what is left is the pull-up, or nothing */
        bool pulled_up = data[PORTC] >> PIN_SENSOR & 1 && !(data[DDRC] >> PIN_SENSOR & 1);
        shown_mv = pulled_up ? SUPPLY_MV : SUPPLY_MV / 2;
    }
    if (handle->millivolts == 0.0) {
        handle->millivolts = shown_mv;
    }
    handle->millivolts += (shown_mv - handle->millivolts) * fmin(1.0, dt_s / FILTER_S);
    return handle->millivolts;
}

const struct wiring HAPKIT = {
    .name = "hapkit",
    .handle = {.mass_kg = 0.05, .damping_n_s_per_m = 0.5, .counts_per_m = RAD_PER_M / 3.14159265358979323846 * 1024,
               .stop_m = 0.035},
    .outside = 1 << PIN_BUTTON | 1 << PIN_TTL,
    .sync_pin = PIN_SYNC,
    .levels = levels,
    .motor_n = motor_n,
    .millivolts = millivolts,
};
