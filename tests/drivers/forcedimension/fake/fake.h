/* The fake SDK's devices: their state, and what the files of the fake share.
 *
 * A bench of devices lives in memory that processes may share (a file), as real devices outlive the programs that open
 * them. All numbers are doubles, so that a test sets and reads them by name.
 */
#ifndef FAKE_H
#define FAKE_H

#include <stdbool.h>

#define F(type, name, ...) type name(__VA_ARGS__);
#include "functions.h"
#undef F

enum { DEVICES = 4, UPDATES = 256 };
enum { FALCON = 60 };
enum mode { RESET, IDLE, FORCE, BRAKE };
enum error { COM = 2, NO_DEVICE = 5, NOT_AVAILABLE = 6, TIMEOUT = 7, EXPERT = 9, NOT_READY = 12, BAD_INDEX = 15,
             NULL_ARGUMENT = 17, IN_USE = 20, INVALID = 21, NO_REGULATION = 22 };
enum cause { NONE, BUTTON, VELOCITY, WATCHDOG, SOFTWARE };

/* S(name, default) a number of a device, V(name) three of them. */
#define DEVICE_FIELDS(S, V) \
    S(present, 1) S(type, 35) S(serial, 1001) S(firmware, 3) S(calibrated, 1) \
    S(mode, IDLE) S(cause, 0) S(error, 0) S(moves, 0) S(misuse, 0) S(holder, 0) \
    S(mass_kg, 0.25) S(viscous_n_s_per_m, 4.4) S(brake_n_s_per_m, 20) S(resolution_m, 1e-5) S(motor_n, 12) \
    S(weight_n, 0) V(hand_n) S(wrist, -1) S(gripper, -1) S(processors, 0) S(button_off, 0) \
    V(position_m) V(velocity_m_per_s) V(measured_m) V(force_n) V(torque_n_m) S(gripper_n, 0) S(gripper_rad, 0.2) \
    S(turn_rad, 0) S(buttons, 0) S(emulate, 0) S(left_gap_negative, 0) \
    S(gravity, 1) S(effector_kg, 0.1) S(angle_deg, 0) S(max_force_n, -1) S(window_ms, 20) \
    S(guard_us, 100) S(watchdog, 0) S(trip_m_per_s, 5) S(has_watchdog, 1) \
    S(heard_us, 0) S(updated_us, 0) S(moved_us, 0) S(started, 0) S(force_calls, 0) S(pose_calls, 0) S(updates, 0) \
    S(status_lag, 0) S(lag_left, 0) S(late_forces, 0) S(late_left, 0) S(stale, 0) S(frozen, 0) S(garbage, 0) S(slow_us, 0) S(slow_calls, 0) \
    S(refuses, 0) S(velocity_fails, 0) S(auto_init_fails, 0) S(auto_init_us, 0) S(stop_fails, 0) S(regulating, 0)

/* Numbers of the bench: period of a tick, devices plugged in, what the SDK calls itself, how time passes. */
#define BENCH_FIELDS(S, V) \
    S(period_us, 1000) S(count, 1) S(major, 3) S(minor, 17) S(no_strings, 0) \
    S(real_time, 0) S(held, 0) S(virtual_us, 0) S(watched_us, 0) S(wall_scale, 0)

#define SCALAR(name, value) double name;
#define VECTOR(name) double name[3];

struct device {
    DEVICE_FIELDS(SCALAR, VECTOR)
    double history_us[UPDATES], history_m[UPDATES][3];
    double coefficient_for[3], x_per_v, x_per_f, v_per_v, v_per_f;
};

struct bench {
    BENCH_FIELDS(SCALAR, VECTOR)
    struct device device[DEVICES];
};

/* bench.c */
extern struct bench *bench;
struct bench *the_bench(void);
double now_us(void);     /* for samples: their age, and their velocity */
double watch_us(void);   /* for the watchdog: a device that moves in real time counts the wall clock by `wall_scale` alone */
void pass(double us);    /* time that is not the wall clock's */
double monotonic_us(void);
void log_call(const char *name);
int fail(int error);
int last_error(void);
void note_processors(struct device *d); /* on how many this thread may run: threads that it starts inherit that */
extern int open_here[DEVICES]; /* 0 closed, 1 open, in this process */

/* device.c */
int settle(struct device *d);     /* what the electronics have done by now; -1 when unplugged */
void heard(struct device *d);     /* a force command came: nothing else feeds the watchdog */
void trip(struct device *d, enum cause cause);
int sample(struct device *d);     /* time passes; 0 a new sample, 1 the last one */
int set_force(struct device *d, const double *force_n);

/* The device behind an ID of an open connection, or a failed call. */
struct device *device_of(int id);

#endif
