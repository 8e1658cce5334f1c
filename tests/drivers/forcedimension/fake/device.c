/* One device: the mechanics of the loopback's model on three axes, and the electronics that may take the force away. */
#include "fake.h"

#include <math.h>
#include <stddef.h>
#include <time.h>

/* m x'' + b x' = F with F held over a period has a closed form; b = 0 is its limit. */
static void prepare(struct device *d, double damping, double period_s) {
    if (d->coefficient_for[0] == d->mass_kg && d->coefficient_for[1] == damping && d->coefficient_for[2] == period_s)
        return;
    double decay = damping / d->mass_kg * period_s;
    double left = exp(-decay);
    double mean = fabs(decay) > 1e-6 ? -expm1(-decay) / decay : 1 - decay / 2;          /* of exp(-a t) */
    double area = fabs(decay) > 1e-3 ? (1 - mean) / decay : 0.5 - decay / 6 + decay * decay / 24;
    d->v_per_v = left;
    d->x_per_v = mean * period_s;
    d->v_per_f = mean * period_s / d->mass_kg;
    d->x_per_f = area * period_s * period_s / d->mass_kg;
    d->coefficient_for[0] = d->mass_kg;
    d->coefficient_for[1] = damping;
    d->coefficient_for[2] = period_s;
}

static void move(struct device *d, double period_s) {
    bool driven = d->mode == FORCE;
    prepare(d, d->viscous_n_s_per_m + (d->mode == BRAKE ? d->brake_n_s_per_m : 0), period_s);
    double squared = 0;
    for (int axis = 0; axis < 3; axis++) {
        double f = d->hand_n[axis] + (driven ? d->force_n[axis] : 0);
        /* The SDK compensates the weight within a force command, so only after the first one. */
        if (axis == 2 && !(driven && d->gravity && d->force_calls))
            f -= d->weight_n;
        double v = d->velocity_m_per_s[axis];
        d->position_m[axis] += v * d->x_per_v + f * d->x_per_f;
        d->velocity_m_per_s[axis] = v * d->v_per_v + f * d->v_per_f;
        squared += d->velocity_m_per_s[axis] * d->velocity_m_per_s[axis];
    }
    if (driven && d->trip_m_per_s > 0 && squared > d->trip_m_per_s * d->trip_m_per_s)
        trip(d, VELOCITY);
}

void trip(struct device *d, enum cause cause) {
    d->mode = d->calibrated ? BRAKE : RESET;
    d->cause = cause;
    d->force_n[0] = d->force_n[1] = d->force_n[2] = d->gripper_n = 0;
}

int settle(struct device *d) {
    if (!d->present)
        return -1;
    if (d->mode == FORCE && d->watchdog > 0 && watch_us() - d->heard_us > d->watchdog * 125)
        trip(d, WATCHDOG);
    return 0;
}

void heard(struct device *d) { d->heard_us = watch_us(); }

static void measure(struct device *d) {
    int at = (int)d->updates % UPDATES;
    for (int axis = 0; axis < 3; axis++) {
        double x = d->position_m[axis];
        if (d->resolution_m > 0)
            x = rint(x / d->resolution_m) * d->resolution_m;
        d->measured_m[axis] = d->history_m[at][axis] = x;
    }
    d->history_us[at] = d->updated_us = now_us();
    d->updates++;
}

/* With `real_time` 0 a period passes with each call for a position but the first, so that a run does not depend on the
 * host's scheduling; with 1 what really has; while time is held none does. */
static double passed_us(struct device *d) {
    struct bench *bench = the_bench();
    double now = bench->real_time ? monotonic_us() : 0, last = d->moved_us;
    d->moved_us = now;
    if (!d->started || bench->held)
        return 0;
    return bench->real_time ? now - last : bench->period_us;
}

int sample(struct device *d) {
    struct bench *bench = the_bench();
    d->pose_calls++;
    if (d->slow_calls > 0 && d->slow_calls--) {
        struct timespec wait = {(time_t)(d->slow_us / 1e6), (long)fmod(d->slow_us * 1e3, 1e9)};
        nanosleep(&wait, NULL);
    }
    double us = passed_us(d);
    if (us > 0) {
        if (bench->real_time)
            bench->virtual_us += us;
        else
            pass(us);
        move(d, us * 1e-6);
    }
    if (d->frozen)
        return 0;
    if (d->stale || (d->started && d->guard_us > 0 && now_us() - d->updated_us < d->guard_us))
        return 1;
    d->started = 1;
    measure(d);
    return 0;
}

int set_force(struct device *d, const double *force_n) {
    double squared = 0;
    for (int axis = 0; axis < 3; axis++)
        squared += force_n[axis] * force_n[axis];
    if (!(squared < INFINITY))
        return fail(INVALID);
    heard(d);
    d->force_calls++;
    if (d->mode != FORCE)
        return 0; /* nothing tells the caller: only the status does */
    if (d->late_left > 0) { /* nor while it takes its time to switch the motors on */
        d->late_left--;
        return 0;
    }
    double norm = sqrt(squared), share = 1;
    if (d->max_force_n >= 0 && norm > d->max_force_n)
        share = d->max_force_n / norm;
    int saturated = norm * share > d->motor_n * (1 + 1e-12);
    if (saturated)
        share = d->motor_n / norm;
    for (int axis = 0; axis < 3; axis++)
        d->force_n[axis] = share * force_n[axis];
    return saturated ? 2 : 0;
}
