/* The dhd half of the fake SDK: the documented semantics, the errors, and nothing more helpful than the real one. */
#include "fake.h"

#include <math.h>
#include <stddef.h>

/* DEVICE: the device of ID, or return -1 with the error of this thread set. */
#define CALL log_call(__func__)
#define DEVICE(d) CALL; struct device *d = device_of(ID); if (!d) return -1
#define EXPERT_DEVICE(d) CALL; if (!expert) return fail(EXPERT); struct device *d = device_of(ID); if (!d) return -1

static int expert;

int fake_expert(void) { return expert; }

static bool left_handed(const struct device *d) {
    int type = (int)d->type;
    return type == 36 || type == 37 || type == 105 || type == 109 || type == 132;
}
static bool has_wrist(const struct device *d) {
    return d->wrist < 0 ? d->type != 33 && d->type != 63 && d->type != FALCON : d->wrist != 0;
}
static bool has_gripper(const struct device *d) {
    return d->gripper < 0 ? has_wrist(d) && d->type != 34 && d->type != 36 : d->gripper != 0;
}
static bool has_watchdog(const struct device *d) { return d->has_watchdog && d->type != FALCON; }

int dhdErrorGetLast(void) { return last_error(); }

const char *dhdErrorGetLastStr(void) {
    static const char *const texts[] = {
        [0] = "no error", [COM] = "communication error", [NO_DEVICE] = "no device found",
        [NOT_AVAILABLE] = "not available", [TIMEOUT] = "timeout", [EXPERT] = "expert mode disabled",
        [NOT_READY] = "device not ready", [BAD_INDEX] = "invalid index", [NULL_ARGUMENT] = "null argument",
        [IN_USE] = "device already in use", [INVALID] = "invalid argument", [NO_REGULATION] = "regulation not running"};
    return the_bench()->no_strings ? NULL : texts[last_error()];
}

int dhdGetDeviceCount(void) {
    CALL;
    int count = 0;
    for (int id = 0; id < bench->count; id++)
        count += bench->device[id].present != 0;
    return count;
}

int dhdGetAvailableCount(void) {
    CALL;
    int count = 0;
    for (int id = 0; id < bench->count; id++)
        count += bench->device[id].present && !bench->device[id].holder;
    return count;
}

void dhdGetSDKVersion(int *major, int *minor, int *release, int *revision) {
    CALL;
    *major = (int)bench->major, *minor = (int)bench->minor, *release = 5, *revision = 0;
}

int dhdGetSystemType(char ID) { DEVICE(d); return (int)d->type; }

const char *dhdGetSystemName(char ID) {
    CALL;
    struct device *d = device_of(ID);
    return d && !bench->no_strings ? "fake haptic device" : NULL;
}

int dhdGetSerialNumber(unsigned short *sn, char ID) { DEVICE(d); *sn = (unsigned short)d->serial; return 0; }
int dhdGetVersion(double *ver, char ID) { DEVICE(d); *ver = d->firmware; return 0; }
bool dhdIsLeftHanded(char ID) { CALL; struct device *d = device_of(ID); return d && left_handed(d); }
bool dhdHasWrist(char ID) { CALL; struct device *d = device_of(ID); return d && has_wrist(d); }
bool dhdHasGripper(char ID) { CALL; struct device *d = device_of(ID); return d && has_gripper(d); }

int dhdGetStatus(int *status, char ID) {
    DEVICE(d);
    int mode = (int)d->mode;
    if (mode == FORCE && d->late_left > 0)
        mode = IDLE;
    if (mode == FORCE && d->lag_left > 0) {
        d->lag_left--;
        mode = IDLE;
    }
    int values[17] = {1, 1, 1, mode == RESET, mode == IDLE, mode == FORCE, mode == BRAKE, 0, has_wrist(d),
                      (int)d->error, d->gravity != 0, (int)d->guard_us, d->calibrated != 0, 0, (int)d->cause, 0,
                      d->calibrated ? 0x7f : 0};
    for (int at = 0; at < 17; at++)
        status[at] = values[at];
    return 0;
}

int dhdGetPosition(double *px, double *py, double *pz, char ID) {
    DEVICE(d);
    int cached = sample(d);
    double x = d->measured_m[0];
    *px = d->garbage == 1 ? NAN : d->garbage == 2 ? 1e30 : x, *py = d->measured_m[1], *pz = d->measured_m[2];
    return cached;
}

int dhdGetPositionAndOrientationFrame(double *px, double *py, double *pz, double *matrix, char ID) {
    int result = dhdGetPosition(px, py, pz, ID);
    if (result < 0)
        return result;
    double c = cos(bench->device[(int)ID].turn_rad), s = sin(bench->device[(int)ID].turn_rad);
    double frame[9] = {c, -s, 0, s, c, 0, 0, 0, 1}; /* about z, row by row */
    for (int at = 0; at < 9; at++)
        matrix[at] = frame[at];
    return result;
}

int dhdGetLinearVelocity(double *vx, double *vy, double *vz, char ID) {
    DEVICE(d);
    if (d->velocity_fails)
        return fail((int)d->velocity_fails);
    int newest = (int)d->updates - 1, oldest = newest;
    while (oldest > 0 && newest - oldest < UPDATES - 1 &&
           now_us() - d->history_us[(oldest - 1) % UPDATES] <= d->window_ms * 1000)
        oldest--;
    double span_s = oldest < 0 || newest < 1 ? 0 : (d->history_us[newest % UPDATES] - d->history_us[oldest % UPDATES]) * 1e-6;
    if (span_s <= 0)
        return fail(TIMEOUT);
    double *const out[] = {vx, vy, vz};
    for (int axis = 0; axis < 3; axis++)
        *out[axis] = (d->history_m[newest % UPDATES][axis] - d->history_m[oldest % UPDATES][axis]) / span_s;
    return 0;
}

int dhdConfigLinearVelocity(int ms, int mode, char ID) {
    DEVICE(d);
    if (mode != 0 || ms < 1)
        return fail(INVALID);
    d->window_ms = ms;
    return 0;
}

int dhdGetGripperGap(double *g, char ID) {
    DEVICE(d);
    if (!has_gripper(d))
        return fail(NOT_AVAILABLE);
    double gap_m = 0.05 * d->gripper_rad;
    *g = left_handed(d) && d->left_gap_negative ? -gap_m : gap_m; /* which one is not documented */
    return 0;
}

unsigned int dhdGetButtonMask(char ID) {
    CALL;
    struct device *d = device_of(ID);
    if (!d)
        return 0;
    return (unsigned)d->buttons | (d->emulate && d->gripper_rad < 0.02 ? 1u : 0u);
}

int dhdEmulateButton(unsigned char val, char ID) {
    DEVICE(d);
    if (!has_gripper(d))
        return fail(NOT_AVAILABLE);
    d->emulate = val;
    return 0;
}

int dhdSetForceAndTorqueAndGripperForce(double fx, double fy, double fz, double tx, double ty, double tz, double fg,
                                        char ID) {
    DEVICE(d);
    int result = set_force(d, (double[]){fx, fy, fz});
    if (result >= 0 && d->mode == FORCE) {
        d->torque_n_m[0] = tx, d->torque_n_m[1] = ty, d->torque_n_m[2] = tz;
        d->gripper_n = left_handed(d) ? -fg : fg;
    }
    return result;
}

int dhdSetMaxForce(double f, char ID) { DEVICE(d); d->max_force_n = f; return 0; }

int dhdEnableForce(unsigned char val, char ID) {
    DEVICE(d);
    if (val && !d->calibrated && d->type != FALCON)
        return fail(NOT_READY);
    trip(d, NONE);
    if (val && !d->button_off) { /* with the button on its front off the device takes no force, and no call says so */
        d->mode = FORCE;
        d->lag_left = d->status_lag;
        d->late_left = d->late_forces;
        d->force_calls = 0;
        heard(d);
    }
    return 0;
}

int dhdSetBrakes(int val, char ID) {
    DEVICE(d);
    if (d->type == FALCON)
        return fail(NOT_AVAILABLE);
    if (d->calibrated && d->mode != FORCE)
        d->mode = val ? BRAKE : IDLE;
    return 0;
}

int dhdStop(char ID) {
    DEVICE(d);
    if (d->stop_fails > 0) {
        d->stop_fails--;
        return fail(COM);
    }
    trip(d, SOFTWARE);
    return 0;
}

int dhdSetGravityCompensation(int val, char ID) {
    DEVICE(d);
    if (d->type == FALCON)
        return fail(NOT_AVAILABLE);
    d->gravity = val;
    return 0;
}

int dhdSetEffectorMass(double mass, char ID) { DEVICE(d); d->effector_kg = mass; return 0; }
int dhdSetDeviceAngleDeg(double angle, char ID) { DEVICE(d); d->angle_deg = angle; return 0; }

int dhdEnableExpertMode(void) { CALL; expert = 1; return 0; }
int dhdDisableExpertMode(void) { CALL; expert = 0; return 0; }

int dhdSetWatchdog(unsigned char val, char ID) {
    EXPERT_DEVICE(d);
    if (!has_watchdog(d))
        return fail(NOT_AVAILABLE);
    d->watchdog = val;
    return 0;
}

int dhdGetWatchdog(unsigned char *val, char ID) {
    EXPERT_DEVICE(d);
    if (!has_watchdog(d))
        return fail(NOT_AVAILABLE);
    *val = (unsigned char)d->watchdog;
    return 0;
}

int dhdSetTimeGuard(int us, char ID) { EXPERT_DEVICE(d); d->guard_us = us < 0 ? 100 : us; return 0; }
