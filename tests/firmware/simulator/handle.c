#include "handle.h"

#include <math.h>

void handle_move(struct handle *handle, double dt_s)
{
    double grip_n = -handle->grip_stiffness_n_per_m * (handle->position_m - handle->grip_rest_m) -
                    handle->grip_damping_n_s_per_m * handle->velocity_m_per_s;
    double force_n = handle->motor_n + handle->hand_n + grip_n - handle->damping_n_s_per_m * handle->velocity_m_per_s;
    /* Semi-implicit Euler: a microsecond a step is short against everything that is here. */
    handle->velocity_m_per_s += force_n / handle->mass_kg * dt_s;
    handle->position_m += handle->velocity_m_per_s * dt_s;
    if (fabs(handle->position_m) > handle->stop_m) { /* no bounce */
        handle->position_m = copysign(handle->stop_m, handle->position_m);
        handle->velocity_m_per_s = 0.0;
    }
}

long handle_counts(const struct handle *handle)
{
    return lrint(handle->position_m * handle->counts_per_m);
}

/* How many edges the disc has passed: those of channel A lie two counts apart, and one of B between each two of them. */
static long edges_passed(const struct handle *handle)
{
    double counts = handle->position_m * handle->counts_per_m - (double)handle->offset;
    double before = 2.0 * floor((counts - 0.5) / 2.0) + 0.5; /* the last edge of A */
    bool passed_b = counts >= before + 1.0 + handle->phase_error_deg / 90.0;
    return lround(before + 0.5) + passed_b;
}

unsigned handle_channels(struct handle *handle)
{
    static const unsigned GRAY[4] = {0, 1, 3, 2};
    long counts = edges_passed(handle);
    if (counts != handle->shown) {
        handle->shown += counts > handle->shown ? 1 : -1;
    }
    unsigned channels = GRAY[handle->shown & 3];
    return handle->broken_wire ? channels & 1 : channels;
}

void handle_place(struct handle *handle, double position_m)
{
    handle->position_m = position_m;
    handle->velocity_m_per_s = 0.0;
    handle->offset = handle_counts(handle) - handle->shown;
}
