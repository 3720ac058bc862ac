/* The event reference: which commands execute, and what the axes are told (docs/robot-link.md, "Exactly once" and
 * "Coming to rest"). Nothing here reads a clock or a socket: the caller says what time it is. */
#ifndef EVENTS_H
#define EVENTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { AXES = 2, ISSUES = 1024, PRESSES = 256, PRESS_BYTES = 257 };

extern const double HOLD;            /* s */
extern const double MAX_EVENT_AGE;   /* s */
extern const double FASTEST[AXES];   /* unit/s, both ways; 0 is rest */
extern const double SLEW[AXES];      /* unit/s per second */
extern const double BRAKE[AXES];

typedef struct {
    double time;               /* s, when */
    uint64_t nonce;            /* that a command has to name */
    uint32_t spell;            /* of the events' spell */
} issued;

typedef struct {
    char id[PRESS_BYTES];
    uint64_t number;
} press;

typedef struct {
    uint32_t current;          /* s */
    uint32_t pending;          /* executed, waiting for its feedback; 0: none */
    uint32_t issue;            /* of the newest feedback of s */
    issued issues[ISSUES];     /* by issue modulo ISSUES */
    double answer_at;          /* s, when an answer would be due if all of them kept the event rate */
    bool wanted;               /* a feedback is wanted at the end of this tick */
    uint32_t rested;           /* moving commands up to this event are void; 0: none */
    bool neutral_needed;       /* no moving command executes before a neutral one */
    uint32_t spell;            /* counts the reasons for that: a neutral one from before does not count */
    bool stopped;
    uint64_t number;           /* of the newest stop; 0 before the first */
    uint64_t last_number;      /* no number up to this is given again */
    uint64_t shown;            /* newest stop that a feedback has shown */
    double stopped_at;         /* s, when the newest stop came */
    press presses[PRESSES];    /* the newest ones, in a ring */
    uint32_t pressed;          /* how many there were */
    char press[PRESS_BYTES];   /* that became the newest stop */
    char stopped_by[2001], stop_reason[2001];
    double values[AXES];       /* what the axes are told now */
    double targets[AXES];
    bool driven;               /* towards the targets; otherwise to rest */
    double deadline;           /* when all values must be at rest */
} events;

typedef enum { EXECUTED, REPEATED, ABSORBED, REFUSED } verdict;

/* `numbers_after`: no stop gets a number up to this. */
void events_begin(events *of, uint64_t numbers_after);
/* Decides about a command that arrived now; `reason` says why it is refused. */
verdict events_command(events *of, uint32_t event, uint64_t issue, uint64_t nonce, const double *values, size_t count,
                       double now, const char **reason);
/* True: the axes come to rest; false: a newer event was executed. */
bool events_rest(events *of, uint32_t event);
/* The number of this press; `*is_new` is false for a repeat of one that is known. */
uint64_t events_stop(events *of, const char *press, const char *by, const char *reason, double now, bool *is_new);
/* NULL: the stop is released, or was before (`*released` is false). Otherwise why not. */
const char *events_reset(events *of, uint64_t number, double now, bool *released);
/* Whatever moves comes to rest and moves on only after a neutral command. */
void events_need_neutral(events *of);
void events_come_to_rest(events *of);
/* No tick came for too long: the values are at rest now, without a ramp, and a neutral command is needed. */
void events_held_up(events *of);
/* One control tick: the values for the `dt` seconds that begin now. */
void events_step(events *of, double now, double dt);
bool events_at_rest(const events *of);
/* Whether the robot is to be measured now; then `events_issue` makes the feedback's event and issue current. */
bool events_issue_due(const events *of, double now);
void events_issue(events *of, double now, uint64_t nonce);

#endif
