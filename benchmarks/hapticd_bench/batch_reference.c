/* The closed loop of hapticd/simulation/batch by hand in C: omega7-like device, one wall, energy-cycle law.
 *
 * The same arithmetic in the same order, so that results agree to the last bit. batch.py writes the structs of
 * batch_types.h from the records that the compiled Python uses.
 */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "batch_types.h"

#define LIMIT 1e12
#define MOST 1e18
#define FARTHEST 1e6
#define TINY_MOTION 1e-24
#define FELT_SAMPLES 20.0
#define FELT_COUNTS 2.0
#define ROUND 6755399441055744.0

enum { WORK_SPRING, WORK_TOTAL };
enum { PAIRING_EXACT, PAIRING_NEW_FORCE, PAIRING_POWER, PAIRING_HELD_POWER };
enum { FORCE_DELAY_IDENTIFIED, FORCE_DELAY_NONE, FORCE_DELAY_ONE_SAMPLE };
enum { SUM_CYCLE, SUM_START };
enum { RULE_SIGNED, RULE_NON_NEGATIVE, RULE_NON_DECREASING };
enum { PLATEAUS_SKIPPED, PLATEAUS_LITERAL };
enum { CONTACT_LOSS_ENDS_CYCLE, CONTACT_LOSS_IGNORED };
enum { NEW_CONTACT_KEEP, NEW_CONTACT_ENERGY, NEW_CONTACT_DAMPING };
enum { STORED_ENERGY_KEPT, STORED_ENERGY_SUBTRACTED };
enum { CAP_FELT_MASS, CAP_KNOWN_MASS, CAP_FIXED, CAP_NONE };

static inline double bounded(double value) {
    if (-LIMIT < value && value < LIMIT) return value;
    return value > 0.0 ? LIMIT : -LIMIT;
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
        if (s->window_falls >= past && s->window_rises < future) {
            if (s->window_rises == 0) s->window_minimum_j = s->window_energy_j;
            ended = true;
        }
        s->window_falls = 0;
        s->window_rises = 0;
    }
    return ended;
}

static inline void begin(law_state *s, double energy) {
    s->energy_j = energy;
    s->window_energy_j = energy;
    s->window_minimum_j = 0.0;
    s->window_falls = 0;
    s->window_rises = 0;
    s->motion_m2_per_s = 0.0;
    s->candidate_motion_m2_per_s = 0.0;
    s->candidate_stored_j = 0.0;
    s->stored_j = 0.0;
}

static inline void feel(law_state *s, const law_params *p, const law_tick *t) {
    double applied = t->applied_n;
    double moved = t->moved_m;
    double dt = t->dt_s;
    bool seen = applied != 0.0 && s->last_applied_n != 0.0 && s->older_applied_n != 0.0;
    if (seen && fabs(moved) > FELT_COUNTS * t->resolution_m) {
        double w = moved / dt - s->last_moved_m / s->last_dt_s;
        double mean = 0.5 * (moved + s->last_moved_m);
        double u = 0.5 * (applied * dt + s->last_applied_n * s->last_dt_s);
        double late_u = 0.5 * (s->last_applied_n * dt + s->older_applied_n * s->last_dt_s);
        double keep = p->felt_mass_memory;
        s->count = keep * s->count + 1.0;
        s->sum_w = keep * s->sum_w + w;
        s->sum_s = keep * s->sum_s + mean;
        s->sum_ss = keep * s->sum_ss + mean * mean;
        s->sum_sw = keep * s->sum_sw + mean * w;
        s->sum_u = keep * s->sum_u + u;
        s->sum_uu = keep * s->sum_uu + u * u;
        s->sum_us = keep * s->sum_us + u * mean;
        s->sum_uw = keep * s->sum_uw + u * w;
        s->late_sum_u = keep * s->late_sum_u + late_u;
        s->late_sum_uu = keep * s->late_sum_uu + late_u * late_u;
        s->late_sum_us = keep * s->late_sum_us + late_u * mean;
        s->late_sum_uw = keep * s->late_sum_uw + late_u * w;
    }
    s->last_moved_m = moved;
    s->last_dt_s = dt;
    s->older_applied_n = s->last_applied_n;
    s->last_applied_n = applied;
}

static inline void believe(law_state *s, const law_params *p) {
    double mean_u = s->sum_u / s->count;
    double mean_late_u = s->late_sum_u / s->count;
    double variance = s->sum_uu - mean_u * s->sum_u;
    double covariance = s->sum_uw - mean_u * s->sum_w;
    double late_variance = s->late_sum_uu - mean_late_u * s->late_sum_u;
    double late_covariance = s->late_sum_uw - mean_late_u * s->sum_w;
    double variance_s = s->sum_ss - s->sum_s * s->sum_s / s->count;
    bool braked = true;
    if (variance_s > 0.0) {
        double us = s->sum_us - mean_u * s->sum_s;
        double late_us = s->late_sum_us - mean_late_u * s->sum_s;
        double sw = s->sum_sw - s->sum_s * s->sum_w / s->count;
        variance -= us * us / variance_s;
        covariance -= us * sw / variance_s;
        late_variance -= late_us * late_us / variance_s;
        late_covariance -= late_us * sw / variance_s;
        double pushed = sw * variance - us * covariance;
        braked = pushed * s->period_s <= 0.005 * variance * variance_s;
    }
    double explained = 0.0;
    double late_explained = 0.0;
    if (variance > 0.0 && covariance > 0.0) explained = covariance * covariance / variance;
    if (late_variance > 0.0 && late_covariance > 0.0) {
        late_explained = late_covariance * late_covariance / late_variance;
    }
    if (p->force_delay == FORCE_DELAY_IDENTIFIED && (explained > 0.0 || late_explained > 0.0)) {
        s->forces_late = late_explained > explained || !braked;
    }
    if (s->forces_late) {
        if (late_explained > 0.0) s->felt_mass_kg = bounded(late_variance / late_covariance);
    } else if (explained > 0.0) {
        s->felt_mass_kg = bounded(variance / covariance);
    }
}

static inline void count_energy(law_state *s, const law_params *p, const law_tick *t) {
    double velocity = t->velocity_m_per_s;
    double work;
    if (p->pairing == PAIRING_EXACT || p->pairing == PAIRING_HELD_POWER) {
        double held = p->work == WORK_SPRING ? t->applied_contact_n : t->applied_n;
        work = s->forces_late ? s->last_work_n : held;
        s->last_work_n = held;
    } else {
        work = t->contact_n;
        if (p->work == WORK_TOTAL && t->in_contact) work = work - s->damping_n_s_per_m * velocity;
    }
    double moved;
    if (p->pairing == PAIRING_EXACT || p->pairing == PAIRING_NEW_FORCE) {
        moved = t->moved_m;
    } else {
        moved = velocity * t->dt_s;
    }
    s->energy_j -= work * moved;
    if (t->in_contact) {
        s->motion_m2_per_s += velocity * velocity * t->dt_s;
        if (t->x_m < s->lowest_m) s->lowest_m = t->x_m;
        if (t->x_m > s->highest_m) s->highest_m = t->x_m;
    }
}

static inline void end_cycle(law_state *s, const law_params *p, const law_tick *t) {
    double gained = s->window_minimum_j;
    double pure = gained - (s->candidate_stored_j - s->stored_j);
    double motion = s->candidate_motion_m2_per_s;
    double travel = s->highest_m - s->lowest_m;
    if (motion > TINY_MOTION && travel >= p->min_travel_counts * t->resolution_m) {
        bool subtract = p->stored_energy == STORED_ENERGY_SUBTRACTED;
        double change = bounded(-(subtract ? pure : gained) / motion);
        bool small = travel < p->small_travel_counts * t->resolution_m;
        if (small && change > 0.0 && p->small_leaks > 0.0 && p->sum == SUM_CYCLE) {
            double enough = p->small_leaks * bounded(-pure / motion) - s->damping_n_s_per_m;
            if (enough < change) change = enough;
            if (change < 0.0) change = 0.0;
        }
        if (change < 0.0 && p->rule == RULE_NON_DECREASING) change = 0.0;
        s->damping_n_s_per_m += change;
        if (s->damping_n_s_per_m < 0.0 && p->rule == RULE_NON_NEGATIVE) s->damping_n_s_per_m = 0.0;
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

static inline bool keep_period(law_state *s, double dt_s) {
    bool first = !s->period_is_known;
    if (first) {
        s->period_is_known = s->period_s > 0.0;
        if (!s->period_is_known || dt_s < s->period_s) s->period_s = dt_s;
    }
    double bounded_s = dt_s < 2.0 * s->period_s ? dt_s : 2.0 * s->period_s;
    s->period_s += 0.01 * (bounded_s - s->period_s);
    return first && s->period_is_known;
}

static inline double damping_cap(law_state *s, const law_params *p) {
    double cap = p->cap_damping_n_s_per_m;
    if (p->cap == CAP_NONE) {
        cap = LIMIT;
    } else if (p->cap != CAP_FIXED) {
        double mass = p->cap == CAP_KNOWN_MASS ? p->mass_kg : s->felt_mass_kg;
        if (mass > 0.0) cap = (s->forces_late ? p->late_cap_share : p->cap_share) * mass / s->period_s;
        if (p->cap == CAP_FELT_MASS && cap > 300.0) cap = 300.0;
    }
    return cap;
}

static inline void begin_inside(law_state *s, const law_tick *t) {
    double start = s->lowest_m;
    if (t->in_contact && start * t->x_m > 0.0) {
        begin(s, s->energy_j + bounded(0.5 * fabs(t->spring_n * start) * fabs(start / t->x_m)));
        s->was_in_contact = true;
    }
}

static inline double law_step(law_state *s, const law_params *p, const law_tick *t) {
    if (p->cap == CAP_FELT_MASS || p->force_delay == FORCE_DELAY_IDENTIFIED) feel(s, p, t);
    if (s->period_s == 0.0) begin_inside(s, t);
    if (keep_period(s, t->dt_s)) s->damping_n_s_per_m = s->uncut_n_s_per_m;
    if (t->in_contact && !s->was_in_contact && p->new_contact != NEW_CONTACT_KEEP) {
        begin(s, 0.0);
        if (p->new_contact == NEW_CONTACT_DAMPING) s->damping_n_s_per_m = 0.0;
    }
    s->was_in_contact = t->in_contact;
    count_energy(s, p, t);
    if (p->plateaus == PLATEAUS_LITERAL && s->energy_j == s->window_energy_j) {
        s->window_falls = 0;
        s->window_rises = 0;
    }
    bool inside = t->in_contact || p->contact_loss == CONTACT_LOSS_IGNORED;
    int64_t future = p->window_future > 0 ? p->window_future : p->window;
    bool ended = cycle_ended(s, s->energy_j, inside, p->window, future);
    if (s->window_rises == 0 && (!ended || s->window_minimum_j == s->energy_j)) {
        s->candidate_motion_m2_per_s = s->motion_m2_per_s;
        s->candidate_stored_j = 0.5 * fabs(t->x_m * t->spring_n);
    }
    if (ended) {
        if (s->count >= FELT_SAMPLES) believe(s, p);
        end_cycle(s, p, t);
    }
    double cap = damping_cap(s, p);
    if (!s->period_is_known) s->uncut_n_s_per_m = s->damping_n_s_per_m;
    if (s->damping_n_s_per_m > cap) {
        s->damping_n_s_per_m = cap;
    } else if (s->damping_n_s_per_m < -cap) {
        s->damping_n_s_per_m = -cap;
    }
    if (!t->in_contact) return 0.0;
    double force = t->contact_n - s->damping_n_s_per_m * t->velocity_m_per_s;
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
        x = (x / p->resolution_m + ROUND - ROUND) * p->resolution_m;
    }
    s->measured_m = x;
}

static inline void run(plant_state *plant, const plant_params *epochs, loop_state *loop, const loop_params *params,
                       const segment *segments, law_state *state, const law_params *law, law_tick *tick,
                       bool settling) {
    for (int64_t at = params->first_segment; at < params->end_segment; at++) {
        const segment *now = &segments[at];
        const plant_params *mechanics = &epochs[now->epoch];
        double stiffness = now->stiffness_n_per_m;
        bool last_window = now->last_window;
        for (int64_t count = now->start; count < now->stop; count++) {
            loop->ticks = count;
            move_and_sense(plant, mechanics, loop->force_n);
            double x = plant->measured_m;
            if (!(-FARTHEST < x && x < FARTHEST)) {
                loop->finite = false;
                return;
            }
            double velocity = (x - loop->last_m) / params->dt_s;
            loop->velocity_m_per_s = velocity;
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
                tick->spring_n = -stiffness * x;
            } else {
                tick->in_contact = false;
                tick->spring_n = 0.0;
            }
            tick->contact_n = tick->spring_n;
            double force = law_step(state, law, tick);
            loop->damping_n_s_per_m = state->damping_n_s_per_m;
            loop->felt_mass_kg = state->felt_mass_kg;
            if (!tick->in_contact) force = 0.0;
            if (!(-MOST < force && force < MOST)) {
                loop->finite = false;
                return;
            }
            double share = 1.0;
            if (force > params->limit_n || force < -params->limit_n) share = params->limit_n / fabs(force);
            tick->applied_n = share * force;
            tick->applied_contact_n = share * tick->contact_n;
            loop->force_n = tick->applied_n;
            if (tick->applied_n > loop->peak_force_n) {
                loop->peak_force_n = tick->applied_n;
            } else if (tick->applied_n < -loop->peak_force_n) {
                loop->peak_force_n = -tick->applied_n;
            }
            if (settling) {
                double off = plant->x_m - params->target_m;
                if (!(-params->band_m <= off && off <= params->band_m)) loop->outside_tick = count;
            }
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
           const law_tick *ticks, bool settling) {
    for (int64_t at = first; at < stop; at++) {
        plant_state plant = plants[at];
        loop_state loop = loops[at];
        loop_params given = params[at];
        law_state state = states[at];
        law_params law = laws[at];
        law_tick tick = ticks[at];
        run(&plant, epochs, &loop, &given, segments, &state, &law, &tick, settling);
        loops[at] = loop;
        states[at] = state;
    }
}
