/* A robot for Lockstep in C, with nothing but the standard library and POSIX sockets: a carriage on a table.
 *
 *     cc -O2 -o c_robot *.c -lm
 *     ./c_robot --port 5600          then: lockstep serve --robot tcp://127.0.0.1:5600
 *
 * Written from docs/robot-link.md alone. main.c runs the control loop and answers; events.c decides what executes;
 * links.c has the connections, message.c and pack.c the bytes; robot.c is the robot, and watchdog.c brings it to rest
 * when this file hangs. It knows no secret, so it listens on loopback only. */
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "event_log.h"
#include "events.h"
#include "links.h"
#include "robot.h"
#include "watchdog.h"

static const double TICK = 0.005; /* s */
static const int CATCH_UP = 3;    /* ticks made good after the process was held up */
static const double LONG = 1.0;   /* s; a gap this long counts also while nothing moved */

static events event_core;
static robot carriage;
static buffer feedback; /* the newest, as a frame: a repeated command gets it again */
static uint8_t picture[PICTURE_BYTES];
static volatile sig_atomic_t ending;

static void end_soon(int signal) {
    (void)signal;
    ending = 1;
}

/* It goes on while the machine is suspended, where there is such a clock: what was left of `hold` must not move it. */
static double now(void) {
    struct timespec time;
#ifdef CLOCK_BOOTTIME
    clock_gettime(CLOCK_BOOTTIME, &time);
#else
    clock_gettime(CLOCK_MONOTONIC, &time);
#endif
    return (double)time.tv_sec + (double)time.tv_nsec / 1e9;
}

/* 64 random bits. Without them a nonce proves nothing: the robot comes to rest and the program ends. */
static uint64_t draw(void) {
    static FILE *random;
    uint64_t drawn = 0;
    if (random == NULL) random = fopen("/dev/urandom", "rb");
    if (random == NULL || fread(&drawn, sizeof drawn, 1, random) != 1) ending = 1;
    return drawn;
}

/* A stop of the run before has a smaller number, as long as the clock does not go back: this robot keeps none. */
static uint64_t numbers_after(void) {
    struct timespec time;
    clock_gettime(CLOCK_REALTIME, &time);
    return (uint64_t)time.tv_sec * 1000000 + (uint64_t)time.tv_nsec / 1000;
}

static void numbers_field(const char *key, const double *numbers, uint32_t count) {
    pack_str(&feedback, key);
    pack_array(&feedback, count);
    for (uint32_t i = 0; i < count; i++) pack_float(&feedback, numbers[i]);
}

static void pack_feedback(double time, uint64_t nonce, bool at_rest) {
    double wrench[6] = {carriage.force[0], carriage.force[1]};
    feedback.size = 0;
    size_t begun = begin_frame(&feedback);
    pack_map(&feedback, 11);
    pack_str(&feedback, "type");
    pack_str(&feedback, "feedback");
    pack_str(&feedback, "event");
    pack_int(&feedback, event_core.current);
    pack_str(&feedback, "issue");
    pack_int(&feedback, event_core.issue);
    pack_str(&feedback, "time");
    pack_float(&feedback, time);
    numbers_field("axes", carriage.velocity, AXES);
    numbers_field("joints", carriage.position, AXES);
    numbers_field("wrench", wrench, 6);
    pack_str(&feedback, "at_rest");
    pack_bool(&feedback, at_rest);
    pack_str(&feedback, "stop");
    pack_map(&feedback, 6);
    pack_str(&feedback, "stopped");
    pack_bool(&feedback, event_core.stopped);
    pack_str(&feedback, "by");
    pack_str(&feedback, event_core.stopped_by);
    pack_str(&feedback, "reason");
    pack_str(&feedback, event_core.stop_reason);
    pack_str(&feedback, "number");
    pack_int(&feedback, (int64_t)event_core.number);
    pack_str(&feedback, "press");
    pack_str(&feedback, event_core.press);
    pack_str(&feedback, "kept");
    pack_bool(&feedback, false); /* this robot has no disk: a stop lasts as long as the program */
    pack_str(&feedback, "nonce");
    pack_int(&feedback, (int64_t)nonce);
    pack_str(&feedback, "neutral_needed");
    pack_bool(&feedback, event_core.neutral_needed);
    end_frame(&feedback, begun);
}

static void publish_notice(double time) {
    buffer notice = {0};
    size_t begun = begin_frame(&notice);
    pack_map(&notice, 3);
    pack_str(&notice, "type");
    pack_str(&notice, "event");
    pack_str(&notice, "event");
    pack_int(&notice, event_core.current);
    pack_str(&notice, "time");
    pack_float(&notice, time);
    end_frame(&notice, begun);
    publish(EVENTS, &notice);
    release(&notice);
}

/* Measures the robot: the answer to the pending command, or the current event again. */
static void issue(void) {
    double time = now();
    uint64_t nonce = 1 + draw() % ((UINT64_C(1) << 53) - 1); /* never that of a command without one */
    bool at_rest = events_at_rest(&event_core) && robot_at_rest(&carriage);
    events_issue(&event_core, time, nonce);
    pack_feedback(time, nonce, at_rest);
    log_feedback(time, event_core.current, event_core.issue, at_rest);
    publish(OPERATOR, &feedback);
    publish_notice(time);
}

/* The state, the event and the time belong to the same instant: nothing runs beside this. */
static void publish_picture(void) {
    double captured = now();
    buffer frame = {0};
    robot_draw(&carriage, event_core.current, picture);
    size_t begun = begin_frame(&frame);
    pack_map(&frame, 8);
    pack_str(&frame, "type");
    pack_str(&frame, "media");
    pack_str(&frame, "stream");
    pack_str(&frame, "above");
    pack_str(&frame, "codec");
    pack_str(&frame, "yuv420p");
    pack_str(&frame, "stamp");
    pack_int(&frame, event_core.current);
    pack_str(&frame, "time");
    pack_float(&frame, captured);
    pack_str(&frame, "width");
    pack_int(&frame, WIDTH);
    pack_str(&frame, "height");
    pack_int(&frame, HEIGHT);
    pack_str(&frame, "payload");
    pack_bin(&frame, picture, sizeof picture);
    end_frame(&frame, begun);
    publish(MEDIA, &frame);
    release(&frame);
    log_media(now(), event_core.current, "above", captured);
}

static void rest_at_once(void) { robot_rest(&carriage); }

/* Nobody knows what the robot did while the loop was held up: it rests without a ramp, and whoever drives begins anew. */
static void look_for_gap(double time) {
    static double last = -1;
    double gap = last < 0 ? 0 : time - last;
    last = time;
    if (gap <= (events_at_rest(&event_core) ? LONG : WATCHDOG)) return;
    events_held_up(&event_core);
    log_stall(time, event_core.current, gap);
}

static void tick(void) {
    static bool rested = true;
    look_for_gap(now());
    events_step(&event_core, now(), TICK);
    robot_tick(&carriage, event_core.values, TICK);
    if (events_at_rest(&event_core) != rested) {
        rested = !rested;
        log_plain(now(), event_core.current, rested ? "at_rest" : "driven");
    }
    if (events_issue_due(&event_core, now())) issue();
}

static void refuse(peer *to, uint32_t event, const char *reason) {
    log_refused(now(), event, reason, event_core.current);
    send_refusal(to, event, reason, event_core.current, 0);
}

static void stop(peer *from, const message *given) {
    bool is_new;
    uint64_t number = events_stop(&event_core, given->press, given->by, given->reason, now(), &is_new);
    if (is_new) log_plain(now(), event_core.current, "stop");
    send_stop_taken(from, given->press, number, false);
}

static void reset(peer *from, const message *given) {
    bool released;
    const char *reason = events_reset(&event_core, given->number, now(), &released);
    if (released) log_plain(now(), event_core.current, "reset");
    if (reason == NULL) return;
    log_refused(now(), 0, reason, event_core.current);
    send_refusal(from, 0, reason, event_core.current, given->number);
}

static void command(peer *from, const message *given) {
    const char *reason;
    double time = now();
    switch (events_command(&event_core, given->event, given->issue, given->nonce, given->values, given->count, time,
                           &reason)) {
    case EXECUTED: log_executed(time, given->event, given->issue, given->values, given->count); break;
    case REPEATED: send_feedback(from, &feedback); break;
    case ABSORBED: break;
    case REFUSED: refuse(from, given->event, reason); break;
    }
}

static void on_opened(role who) {
    if (who == OPERATOR) events_need_neutral(&event_core);
    if (who != MEDIA) event_core.wanted = true;
}

static void on_said(peer *from, const message *given) {
    switch (given->type) {
    case COMMAND: command(from, given); break;
    case REST: log_rest(now(), given->event, events_rest(&event_core, given->event)); break;
    case STOP: stop(from, given); break;
    case RESET: reset(from, given); break;
    default: break;
    }
}

static void on_operator_lost(void) { events_come_to_rest(&event_core); }

static void run(void) {
    double next_tick = now(), next_picture = next_tick;
    while (!ending || !events_at_rest(&event_core)) {
        links_serve(fmin(next_tick, next_picture) - now(), now);
        if (ending) events_come_to_rest(&event_core);
        double time = now();
        if (time - next_tick > CATCH_UP * TICK) next_tick = time - CATCH_UP * TICK;
        for (; next_tick <= time; next_tick += TICK) tick();
        watchdog_ticked();
        if (next_picture <= time) {
            next_picture = fmax(next_picture + 1 / FRAME_RATE, time);
            publish_picture();
        }
    }
}

int main(int count, char **words) {
    static const handler ROBOT = {on_opened, on_said, refuse, on_operator_lost};
    struct sigaction action = {.sa_handler = end_soon};
    int port = 5600;
    char epoch[17];
    for (int i = 1; i < count; i += 2) {
        bool valued = i + 1 < count;
        if (valued && strcmp(words[i], "--port") == 0) {
            port = atoi(words[i + 1]);
        } else if (valued && strcmp(words[i], "--event-log") == 0) {
            if (!log_open(words[i + 1])) return perror(words[i + 1]), 1;
        } else {
            return fprintf(stderr, "usage: %s [--port NUMBER] [--event-log FILE]\n", words[0]), 2;
        }
    }
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    snprintf(epoch, sizeof epoch, "%016llx", (unsigned long long)draw());
    events_begin(&event_core, numbers_after());
    if (!links_listen(&port, &ROBOT, epoch)) return perror("cannot listen"), 1;
    log_start(now(), event_core.current, epoch);
    issue();
    printf("{\"robot\": \"tcp://127.0.0.1:%d\"}\n", port);
    fflush(stdout);
    watchdog_start(rest_at_once);
    run();
    links_close(now);
    watchdog_end();
    log_close();
    release(&feedback);
    return 0;
}
