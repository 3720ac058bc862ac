#include "events.h"

#include <math.h>
#include <string.h>

static const uint32_t LAST_EVENT = 0x7fffffff;
static const double LEAST_STOP = 1.0; /* s between the newest stop and a reset */
static const double HELD_UP = 1.5; /* s without a feedback, after which a reset may have waited as long */
static const double EVENT_INTERVAL = 1 / 25.0; /* s, of max_event_rate; the description leaves it at its default */
static const int BURST = 2;                    /* events that may come ahead of it */
static const double REFRESH = 0.5; /* s between feedbacks while nothing is commanded */

static uint32_t event_after(uint32_t event) { return event == LAST_EVENT ? 1 : event + 1; }

/* How much newer a is than b: serial arithmetic of 31 bits (RFC 1982). */
static int64_t event_gap(uint32_t a, uint32_t b) {
    int64_t half = INT64_C(1) << 30, whole = INT64_C(1) << 31;
    int64_t shifted = (int64_t)a - (int64_t)b + half;
    return ((shifted % whole) + whole) % whole - half;
}

void events_begin(events *of, uint64_t numbers_after) {
    memset(of, 0, sizeof *of);
    of->current = 1;
    of->wanted = of->neutral_needed = true;
    of->last_number = numbers_after;
    of->deadline = of->answer_at = -INFINITY;
}

static bool known_and_fresh(const events *of, uint64_t issue, double now) {
    if (issue < 1 || issue > of->issue || of->issue - issue >= ISSUES) return false;
    return now - of->issues[issue % ISSUES].time <= MAX_EVENT_AGE;
}

verdict events_command(events *of, uint32_t event, uint64_t issue, uint64_t nonce, const double *values, size_t count,
                       double now, const char **reason) {
    bool moving = false;
    *reason = "wrong_size";
    if (count != AXES) return REFUSED;
    *reason = "not_a_number";
    for (size_t i = 0; i < AXES; i++) {
        if (!isfinite(values[i])) return REFUSED;
        moving = moving || values[i] != 0;
    }
    *reason = "stopped";
    if (of->stopped) return REFUSED;
    if (event == of->current && of->issue > 0) return REPEATED;
    if (of->pending != 0 && event == of->pending) return ABSORBED;
    *reason = "out_of_order";
    if (of->pending != 0 || event != event_after(of->current)) return REFUSED;
    *reason = "late";
    if (!known_and_fresh(of, issue, now)) {
        of->wanted = true;
        return REFUSED;
    }
    *reason = "unseen";
    const issued *answered = &of->issues[issue % ISSUES];
    if (nonce != answered->nonce) return REFUSED;
    *reason = "rested";
    if (moving && of->rested != 0 && event_gap(event, of->rested) <= 0) return REFUSED;
    *reason = "not_neutral";
    if (moving && of->neutral_needed) return REFUSED;
    if (answered->spell == of->spell) of->neutral_needed = false;
    if (!of->neutral_needed) of->pressed = 0; /* it may move: whatever press comes now is a new stop */
    of->pending = event;
    of->rested = 0;
    for (size_t i = 0; i < AXES; i++) of->targets[i] = fmin(fmax(values[i], -FASTEST[i]), FASTEST[i]);
    of->driven = true;
    of->deadline = now + HOLD;
    return EXECUTED;
}

bool events_rest(events *of, uint32_t event) {
    uint32_t newest = of->pending != 0 ? of->pending : of->current, next = event_after(newest);
    int64_t ahead = event_gap(event, newest);
    if (ahead < 0 && event_gap(newest, event) > 0) return false;
    if (ahead > 1 || ahead < 0) event = next; /* half the circle away counts as ahead */
    if (of->rested == 0 || event_gap(event, of->rested) > 0) of->rested = event;
    events_come_to_rest(of);
    return true;
}

static uint64_t number_of(const events *of, const char *press) {
    uint32_t known = of->pressed < PRESSES ? of->pressed : PRESSES;
    for (uint32_t i = 0; i < known; i++)
        if (strcmp(of->presses[i].id, press) == 0) return of->presses[i].number;
    return 0;
}

uint64_t events_stop(events *of, const char *press, const char *by, const char *reason, double now, bool *is_new) {
    uint64_t known = press[0] == '\0' ? 0 : number_of(of, press);
    *is_new = known == 0;
    if (known != 0) return known;
    of->number = ++of->last_number;
    if (press[0] != '\0') {
        strcpy(of->presses[of->pressed % PRESSES].id, press);
        of->presses[of->pressed++ % PRESSES].number = of->number;
    }
    if (!of->stopped) {
        strcpy(of->stopped_by, by);
        strcpy(of->stop_reason, reason);
    }
    strcpy(of->press, press);
    of->stopped = true;
    of->stopped_at = now;
    events_need_neutral(of);
    return of->number;
}

/* After a bridge that was held up the stop counts as new: nobody knows how old the resets are that waited. */
static void look(events *of, double now) {
    if (of->issue != 0 && now - of->issues[of->issue % ISSUES].time > HELD_UP) of->stopped_at = now;
}

const char *events_reset(events *of, uint64_t number, double now, bool *released) {
    *released = false;
    if (number != of->number) return "stale_reset";
    if (!of->stopped) return NULL;
    look(of, now);
    if (now - of->stopped_at < LEAST_STOP || of->shown < of->number) return "too_soon";
    of->stopped = false;
    of->stopped_by[0] = of->stop_reason[0] = '\0';
    events_need_neutral(of);
    *released = true;
    return NULL;
}

void events_need_neutral(events *of) {
    of->neutral_needed = of->wanted = true;
    of->spell++;
    events_come_to_rest(of);
}

void events_come_to_rest(events *of) { of->driven = false; }

void events_held_up(events *of) {
    for (size_t i = 0; i < AXES; i++) of->values[i] = 0;
    events_need_neutral(of);
}

static double towards(double from, double to, double step) {
    return fabs(to - from) <= step ? to : from + copysign(step, to - from);
}

void events_step(events *of, double now, double dt) {
    double left = fmax(of->deadline - now, 0);
    if (left == 0) of->driven = false;
    for (size_t i = 0; i < AXES; i++) {
        double value = of->driven ? towards(of->values[i], of->targets[i], SLEW[i] * dt)
                                  : towards(of->values[i], 0, BRAKE[i] * dt);
        double reach = BRAKE[i] * left; /* from here the brake still brings it to rest in time */
        of->values[i] = fmin(fmax(value, -reach), reach);
    }
}

bool events_at_rest(const events *of) {
    for (size_t i = 0; i < AXES; i++)
        if (of->values[i] != 0 || (of->driven && of->targets[i] != 0)) return false;
    return true;
}

bool events_issue_due(const events *of, double now) {
    if (of->pending != 0 && !of->stopped) return now >= of->answer_at - BURST * EVENT_INTERVAL;
    return of->pending != 0 || of->wanted || now - of->issues[of->issue % ISSUES].time >= REFRESH;
}

void events_issue(events *of, double now, uint64_t nonce) {
    look(of, now);
    if (of->pending != 0) {
        of->current = of->pending;
        of->pending = 0;
        of->issue = 0;
        of->answer_at = fmax(now, of->answer_at) + EVENT_INTERVAL;
    }
    of->issue++;
    of->issues[of->issue % ISSUES] = (issued){now, nonce, of->spell};
    if (of->stopped) of->shown = of->number;
    of->wanted = false;
}
