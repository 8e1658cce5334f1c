/* The closed loop of hapticd/simulation/batch.py by hand in C: omega7-like device, one wall, energy-cycle law.
 *
 * The same arithmetic in the same order, so that results agree to the last bit. batch.py writes the structs of
 * batch_types.h from the records that the compiled Python uses.
 */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "batch_types.h"

#define LIMIT 1e12

enum { WORK_SPRING, WORK_TOTAL };
enum { PAIRING_EXACT, PAIRING_NEW_FORCE, PAIRING_POWER, PAIRING_HELD_POWER };
enum { SUM_CYCLE, SUM_START };
enum { RULE_SIGNED, RULE_NON_NEGATIVE, RULE_NON_DECREASING };
enum { PLATEAUS_SKIPPED, PLATEAUS_LITERAL };
enum { CONTACT_LOSS_ENDS_CYCLE, CONTACT_LOSS_IGNORED };
enum { NEW_CONTACT_KEEP, NEW_CONTACT_ENERGY, NEW_CONTACT_DAMPING };
enum { STORED_KEPT, STORED_SUBTRACTED };
enum { CAP_FELT_MASS, CAP_KNOWN_MASS, CAP_FIXED, CAP_NONE };

static inline double bounded(double value) {
    if (value > LIMIT) return LIMIT;
    if (value < -LIMIT) return -LIMIT;
    return value;
}

static inline bool cycle_ended(law_state *s, double energy, bool in_contact, int64_t past, int64_t future) {
    bool ended = false;
    if (energy < s->window_energy_j) {
        if (s->window_rises > 0) {
            s->window_falls = 0;
            s->window_rises = 0;
        }
        s->window_falls += 1;
        s->window_energy_j = energy;
    } else if (energy > s->window_energy_j) {
        if (s->window_rises == 0) s->window_minimum_j = s->window_energy_j;
        s->window_rises += 1;
        if (s->window_falls >= past && s->window_rises == future) ended = true;
        s->window_energy_j = energy;
    }
    if (!in_contact) {
        if (s->window_falls >= past && s->window_rises == 0) {
            s->window_minimum_j = s->window_energy_j;
            ended = true;
        }
        s->window_falls = 0;
        s->window_rises = 0;
    }
    return ended;
}

static inline void end_cycle(law_state *s, const law_params *p, const law_tick *t) {
    double generated = s->window_minimum_j;
    if (p->stored_energy == STORED_SUBTRACTED) generated -= s->candidate_stored_j - s->stored_j;
    double motion = s->candidate_motion_m2_per_s;
    double travel = s->highest_m - s->lowest_m;
    if (motion > 1e-24 && travel >= p->min_travel_counts * t->resolution_m) {
        double change = bounded(-generated / motion);
        if (p->rule == RULE_NON_DECREASING && change < 0.0) change = 0.0;
        s->damping_n_s_per_m += change;
        if (p->rule == RULE_NON_NEGATIVE && s->damping_n_s_per_m < 0.0) s->damping_n_s_per_m = 0.0;
    }
    s->energy_j -= s->window_minimum_j;
    s->window_energy_j -= s->window_minimum_j;
    s->window_minimum_j = 0.0;
    s->stored_j = s->candidate_stored_j;
    if (p->sum == SUM_CYCLE) {
        s->motion_m2_per_s -= motion;
        s->candidate_motion_m2_per_s = 0.0;
    }
    s->lowest_m = t->x_m;
    s->highest_m = t->x_m;
}

static inline double damping_cap(const law_state *s, const law_params *p, const law_tick *t) {
    double cap = p->cap_damping_n_s_per_m;
    if (p->cap == CAP_NONE) {
        cap = LIMIT;
    } else if (p->cap != CAP_FIXED && t->dt_s > 0.0) {
        double mass = p->cap == CAP_KNOWN_MASS ? p->mass_kg : s->felt_mass_kg;
        if (mass > 0.0) cap = bounded(p->cap_share * mass / t->dt_s);
    }
    return cap;
}

static inline void feel_mass(law_state *s, const law_params *p, const law_tick *t) {
    double moved = bounded(t->moved_m);
    double applied = bounded(t->applied_n);
    double enough = 2.0 * t->resolution_m;
    if (t->dt_s > 0.0 && s->last_dt_s > 0.0 && applied != 0.0 && s->last_applied_n != 0.0 && fabs(moved) > enough) {
        double u = bounded(0.5 * (applied * t->dt_s + s->last_applied_n * s->last_dt_s));
        double w = bounded(bounded(moved / t->dt_s) - bounded(s->last_moved_m / s->last_dt_s));
        double keep = p->felt_mass_memory;
        s->count = keep * s->count + 1.0;
        s->sum_u = keep * s->sum_u + u;
        s->sum_w = keep * s->sum_w + w;
        s->sum_uu = keep * s->sum_uu + u * u;
        s->sum_uw = keep * s->sum_uw + u * w;
        double variance = s->sum_uu - s->sum_u * s->sum_u / s->count;
        double covariance = s->sum_uw - s->sum_u * s->sum_w / s->count;
        if (s->count >= 20.0 && variance > 0.0 && covariance > 0.0) s->felt_mass_kg = bounded(variance / covariance);
    }
    s->last_moved_m = moved;
    s->last_dt_s = t->dt_s;
    s->last_applied_n = applied;
}

static inline void forget(law_state *s, const law_params *p) {
    s->energy_j = 0.0;
    s->window_energy_j = 0.0;
    s->window_falls = 0;
    s->window_rises = 0;
    s->motion_m2_per_s = 0.0;
    s->candidate_motion_m2_per_s = 0.0;
    s->stored_j = 0.0;
    if (p->new_contact == NEW_CONTACT_DAMPING) s->damping_n_s_per_m = 0.0;
}

static inline double law_step(law_state *s, const law_params *p, const law_tick *t) {
    double velocity = bounded(t->velocity_m_per_s);
    double force;
    if (p->cap == CAP_FELT_MASS) feel_mass(s, p, t);
    if (t->in_contact && !s->was_in_contact && p->new_contact != NEW_CONTACT_KEEP) forget(s, p);
    s->was_in_contact = t->in_contact;
    if (p->pairing == PAIRING_EXACT || p->pairing == PAIRING_HELD_POWER) {
        force = p->work == WORK_SPRING ? t->applied_contact_n : t->applied_n;
    } else if (p->work == WORK_SPRING || !t->in_contact) {
        force = t->contact_n;
    } else {
        force = t->contact_n - s->damping_n_s_per_m * velocity;
    }
    double moved;
    if (p->pairing == PAIRING_EXACT || p->pairing == PAIRING_NEW_FORCE) {
        moved = bounded(t->moved_m);
    } else {
        moved = bounded(velocity * t->dt_s);
    }
    s->energy_j = bounded(s->energy_j - bounded(bounded(force) * moved));
    if (t->in_contact) {
        s->motion_m2_per_s = bounded(s->motion_m2_per_s + bounded(velocity * velocity * t->dt_s));
        if (t->x_m < s->lowest_m) s->lowest_m = t->x_m;
        if (t->x_m > s->highest_m) s->highest_m = t->x_m;
    }
    if (p->plateaus == PLATEAUS_LITERAL && s->energy_j == s->window_energy_j) {
        s->window_falls = 0;
        s->window_rises = 0;
    }
    bool inside = t->in_contact || p->contact_loss == CONTACT_LOSS_IGNORED;
    int64_t future = p->window_future > 0 ? p->window_future : p->window;
    bool ended = cycle_ended(s, s->energy_j, inside, p->window, future);
    if (s->window_rises == 0) {
        s->candidate_motion_m2_per_s = s->motion_m2_per_s;
        s->candidate_stored_j = bounded(0.5 * fabs(bounded(t->x_m) * bounded(t->contact_n)));
    }
    if (ended) end_cycle(s, p, t);
    double cap = damping_cap(s, p, t);
    if (s->damping_n_s_per_m > cap) {
        s->damping_n_s_per_m = cap;
    } else if (s->damping_n_s_per_m < -cap) {
        s->damping_n_s_per_m = -cap;
    }
    if (!t->in_contact) return 0.0;
    force = t->contact_n - bounded(s->damping_n_s_per_m * velocity);
    if (force < 0.0 && !p->wall_may_pull) force = 0.0;
    return force;
}

static inline void move_and_sense(plant_state *s, const plant_params *p, double force) {
    double f = force;
    if (f > p->limit_n) {
        f = p->limit_n;
    } else if (f < -p->limit_n) {
        f = -p->limit_n;
    }
    s->applied_n = f;
    f = f + p->hand_n;
    double v = s->v_m_per_s;
    s->x_m = s->x_m + (v * p->x_per_v + f * p->x_per_f);
    s->v_m_per_s = v * p->v_per_v + f * p->v_per_f;
    double x = s->x_m;
    if (p->resolution_m > 0.0) {
        x = (x / p->resolution_m + 6755399441055744.0 - 6755399441055744.0) * p->resolution_m;
    }
    s->measured_m = x;
}

static inline void run(plant_state *plant, const plant_params *epochs, loop_state *loop, const loop_params *params,
                       const segment *segments, law_state *state, const law_params *law, law_tick *tick) {
    for (int64_t at = params->first_segment; at < params->end_segment; at++) {
        const segment *now = &segments[at];
        const plant_params *mechanics = &epochs[now->epoch];
        double stiffness = now->stiffness_n_per_m;
        bool last_window = now->last_window;
        for (int64_t count = now->start; count < now->stop; count++) {
            loop->ticks = count;
            move_and_sense(plant, mechanics, loop->force_n);
            double x = plant->measured_m;
            if (!(-1e6 < x && x < 1e6)) {
                loop->finite = false;
                return;
            }
            double velocity = (x - loop->last_m) / params->dt_s;
            loop->last_m = x;
            if (!(-1e6 < velocity && velocity < 1e6)) {
                loop->finite = false;
                return;
            }
            tick->moved_m = x - tick->x_m;
            tick->x_m = x;
            tick->velocity_m_per_s = velocity;
            if (x < 0.0) {
                tick->in_contact = true;
                tick->contact_n = -stiffness * x;
            } else {
                tick->in_contact = false;
                tick->contact_n = 0.0;
            }
            double force = law_step(state, law, tick);
            if (!tick->in_contact) force = 0.0;
            if (!(-LIMIT < force && force < LIMIT)) {
                loop->finite = false;
                return;
            }
            double share = 1.0;
            if (force > params->limit_n || force < -params->limit_n) share = params->limit_n / fabs(force);
            loop->damping_n_s_per_m = state->damping_n_s_per_m;
            loop->felt_mass_kg = state->felt_mass_kg;
            tick->applied_n = share * force;
            tick->applied_contact_n = share * tick->contact_n;
            loop->force_n = tick->applied_n;
            if (tick->applied_n > loop->peak_force_n) {
                loop->peak_force_n = tick->applied_n;
            } else if (tick->applied_n < -loop->peak_force_n) {
                loop->peak_force_n = -tick->applied_n;
            }
            double off = plant->x_m - params->target_m;
            if (!(-params->band_m <= off && off <= params->band_m)) loop->outside_tick = count;
            if (last_window) {
                if (plant->x_m < loop->low_m) loop->low_m = plant->x_m;
                if (plant->x_m > loop->high_m) loop->high_m = plant->x_m;
                if (plant->measured_m < loop->low_measured_m) loop->low_measured_m = plant->measured_m;
                if (plant->measured_m > loop->high_measured_m) loop->high_measured_m = plant->measured_m;
                loop->sum_x_m += plant->x_m;
                loop->sum_force_n += plant->applied_n;
            }
        }
        loop->ticks = now->stop;
    }
}

void sweep(int64_t first, int64_t stop, plant_state *plants, const plant_params *epochs, loop_state *loops,
           const loop_params *params, const segment *segments, law_state *states, const law_params *laws,
           const law_tick *ticks) {
    for (int64_t at = first; at < stop; at++) {
        plant_state plant = plants[at];
        loop_state loop = loops[at];
        loop_params given = params[at];
        law_state state = states[at];
        law_params law = laws[at];
        law_tick tick = ticks[at];
        run(&plant, epochs, &loop, &given, segments, &state, &law, &tick);
        loops[at] = loop;
        states[at] = state;
    }
}
