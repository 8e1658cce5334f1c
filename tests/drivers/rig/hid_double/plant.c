#include "plant.h"

static const double MASS_KG = 0.2;
static const double VISCOUS_N_S_PER_M = 5.0; /* with the hand's */
static const double STOP_M = 0.0495;
static const double STEP_S = 50e-6;

static void step(struct plant *plant, double motor_n, double time_s)
{
    double force_n = plant->motor_sign * motor_n + plant->hand_n - VISCOUS_N_S_PER_M * plant->v_m_per_s;
    plant->v_m_per_s += force_n / MASS_KG * time_s;
    plant->x_m += plant->v_m_per_s * time_s;
    if (plant->x_m > STOP_M || plant->x_m < -STOP_M) {
        plant->x_m = plant->x_m > 0.0 ? STOP_M : -STOP_M;
        plant->v_m_per_s = 0.0;
    }
}

void plant_advance(struct plant *plant, double motor_n, double time_s)
{
    for (; time_s > STEP_S; time_s -= STEP_S) {
        step(plant, motor_n, STEP_S);
    }
    step(plant, motor_n, time_s);
}
