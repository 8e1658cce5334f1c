/* The mechanics of one axis: a handle with mass and friction between two stops, a hand, a motor. */
#ifndef PLANT_H
#define PLANT_H

struct plant {
    double x_m, v_m_per_s;
    double hand_n;
    double motor_sign; /* -1: its wires are swapped */
};

/* Advance by a time with constant forces. */
void plant_advance(struct plant *plant, double motor_n, double time_s);

#endif
