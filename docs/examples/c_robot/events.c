#include "events.h"

#include <math.h>
#include <string.h>

static const uint32_t LAST_EVENT = 0x7fffffff;
static const double REFRESH = 0.5; /* s between feedbacks while nothing is commanded */

static uint32_t event_after(uint32_t event) { return event == LAST_EVENT ? 1 : event + 1; }

/* How much newer a is than b: serial arithmetic of 31 bits (RFC 1982). */
static int64_t event_gap(uint32_t a, uint32_t b) {
    int64_t half = INT64_C(1) << 30, whole = INT64_C(1) << 31;
    int64_t shifted = (int64_t)a - (int64_t)b + half;
    return ((shifted % whole) + whole) % whole - half;
}

void events_begin(events *of) {
    memset(of, 0, sizeof *of);
    of->current = 1;
    of->wanted = true;
    of->deadline = -INFINITY;
}

static bool known_and_fresh(const events *of, uint64_t issue, double now) {
    if (issue < 1 || issue > of->issue || of->issue - issue >= ISSUES) return false;
    return now - of->issued[issue % ISSUES] <= MAX_EVENT_AGE;
}

verdict events_command(events *of, uint32_t event, uint64_t issue, const double *values, size_t count, double now,
                       const char **reason) {
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
    *reason = "rested";
    if (moving && of->rested != 0 && event_gap(event, of->rested) <= 0) return REFUSED;
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

bool events_stop(events *of, const char *by, const char *reason) {
    if (of->stopped) return false;
    of->stopped = of->wanted = true;
    strcpy(of->stopped_by, by);
    strcpy(of->stop_reason, reason);
    events_come_to_rest(of);
    return true;
}

bool events_reset(events *of) {
    if (!of->stopped) return false;
    of->stopped = false;
    of->wanted = true;
    of->stopped_by[0] = of->stop_reason[0] = '\0';
    return true;
}

void events_come_to_rest(events *of) { of->driven = false; }

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
    return of->pending != 0 || of->wanted || now - of->issued[of->issue % ISSUES] >= REFRESH;
}

void events_issue(events *of, double now) {
    if (of->pending != 0) {
        of->current = of->pending;
        of->pending = 0;
        of->issue = 0;
    }
    of->issue++;
    of->issued[of->issue % ISSUES] = now;
    of->wanted = false;
}
