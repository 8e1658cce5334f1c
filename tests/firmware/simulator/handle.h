/* The mechanics: one mass on a rail between two end stops, a motor and a hand that push it, a sensor. */
#ifndef HANDLE_H
#define HANDLE_H

#include <stdbool.h>

struct handle {
    double position_m, velocity_m_per_s;
    double motor_n; /* what the motor exerts */
    double mass_kg, damping_n_s_per_m;
    double stop_m;       /* either way */
    double counts_per_m; /* of the sensor */

    double hand_n;
    double grip_stiffness_n_per_m, grip_damping_n_s_per_m, grip_rest_m;

    bool reversed;    /* the motor's wires are exchanged */
    bool broken_wire; /* channel B of the encoder, or the sensor's output, is dead */
    double phase_error_deg; /* how much later than a quarter of a period channel B comes, below 90 either way */
    double bend;       /* how uneven a voltage rises over a half turn: its slope varies by this share */
    double millivolts; /* of the sensor */
    bool button;
    bool ttl; /* level at the TTL input */
    long shown;  /* counts that the sensor has shown */
    long offset; /* of its disc or magnet against the handle [counts] */
};

/* Let time pass with the motor's force as it is. */
void handle_move(struct handle *handle, double dt_s);

/* Where it is [counts]. */
long handle_counts(const struct handle *handle);

/* The encoder's channels now, A in bit 0 and B in bit 1, one edge nearer to where the handle is than last time. */
unsigned handle_channels(struct handle *handle);

/* Put it somewhere without disc or magnet turning. */
void handle_place(struct handle *handle, double position_m);

#endif
