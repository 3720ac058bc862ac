/* The event reference: which commands execute, and what the axes are told (docs/robot-link.md, "Exactly once" and
 * "Coming to rest"). Nothing here reads a clock or a socket: the caller says what time it is. */
#ifndef EVENTS_H
#define EVENTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { AXES = 2, ISSUES = 1024 };

extern const double HOLD;            /* s */
extern const double MAX_EVENT_AGE;   /* s */
extern const double FASTEST[AXES];   /* unit/s, both ways; 0 is rest */
extern const double SLEW[AXES];      /* unit/s per second */
extern const double BRAKE[AXES];

typedef struct {
    uint32_t current;          /* s */
    uint32_t pending;          /* executed, waiting for its feedback; 0: none */
    uint32_t issue;            /* of the newest feedback of s */
    double issued[ISSUES];     /* when, by issue modulo ISSUES */
    bool wanted;               /* a feedback is wanted at the end of this tick */
    uint32_t rested;           /* moving commands up to this event are void; 0: none */
    bool stopped;
    char stopped_by[2001], stop_reason[2001];
    double values[AXES];       /* what the axes are told now */
    double targets[AXES];
    bool driven;               /* towards the targets; otherwise to rest */
    double deadline;           /* when all values must be at rest */
} events;

typedef enum { EXECUTED, REPEATED, ABSORBED, REFUSED } verdict;

void events_begin(events *of);
/* Decides about a command that arrived now; `reason` says why it is refused. */
verdict events_command(events *of, uint32_t event, uint64_t issue, const double *values, size_t count, double now,
                       const char **reason);
/* True: the axes come to rest; false: a newer event was executed. */
bool events_rest(events *of, uint32_t event);
/* False: nothing changed. */
bool events_stop(events *of, const char *by, const char *reason);
bool events_reset(events *of);
void events_come_to_rest(events *of);
/* One control tick: the values for the `dt` seconds that begin now. */
void events_step(events *of, double now, double dt);
bool events_at_rest(const events *of);
/* Whether the robot is to be measured now; then `events_issue` makes the feedback's event and issue current. */
bool events_issue_due(const events *of, double now);
void events_issue(events *of, double now);

#endif
