#include <math.h>

#include "wiring.h"

enum { PIN_PWM = 1, PIN_DIRECTION = 2 }; /* of port B */
enum { PIN_A = 2, PIN_B = 3, PIN_HOME_SWITCH = 4, PIN_BUTTON = 5, PIN_TTL = 6, PIN_SYNC = 7 }; /* of port D */
enum { STOP_COUNTS = 6500 }; /* either way */

static const double FULL_FORCE_N = 5.0; /* at a duty of 1 */

static uint8_t levels(struct handle *handle)
{
    unsigned channels = handle_channels(handle);
    bool at_lower_stop = handle_counts(handle) <= -STOP_COUNTS;
    return (uint8_t)((channels & 1) << PIN_A | channels >> 1 << PIN_B | (unsigned)!at_lower_stop << PIN_HOME_SWITCH |
                     (unsigned)!handle->button << PIN_BUTTON | (unsigned)handle->ttl << PIN_TTL);
}

static unsigned data16(const uint8_t *data, unsigned low)
{
    return data[low] | (unsigned)data[low + 1] << 8;
}

static double motor_n(const uint8_t *data)
{
    unsigned both = 1 << PIN_PWM | 1 << PIN_DIRECTION;
    unsigned top = data16(data, ICR1L);
    bool phase_correct = (data[TCCR1A] & 0x83) == 0x82 && (data[TCCR1B] & 0x1f) == 0x11;
    if (!phase_correct || (data[DDRB] & both) != both || top == 0) {
        return 0.0;
    }
    double duty = fmin(1.0, (double)data16(data, OCR1AL) / top);
    return (data[PORTB] >> PIN_DIRECTION & 1 ? duty : -duty) * FULL_FORCE_N;
}

/* 4096 counts a turn of a drum of 10 mm. */
#define COUNTS_PER_M (4096 / (3.14159265358979323846 * 0.010))

const struct wiring UNO = {
    .name = "uno",
    .handle = {.mass_kg = 0.1,
               .damping_n_s_per_m = 1.0,
               .counts_per_m = COUNTS_PER_M,
               .stop_m = STOP_COUNTS / COUNTS_PER_M},
    .outside = 1 << PIN_A | 1 << PIN_B | 1 << PIN_HOME_SWITCH | 1 << PIN_BUTTON | 1 << PIN_TTL,
    .sync_pin = PIN_SYNC,
    .levels = levels,
    .motor_n = motor_n,
};
