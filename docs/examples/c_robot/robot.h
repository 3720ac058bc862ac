/* The robot itself: a carriage on a table, two axes, with springs at the table's edges. */
#ifndef ROBOT_H
#define ROBOT_H

#include <signal.h>

#include "events.h"
#include "pack.h"

enum { WIDTH = 320, HEIGHT = 240, PICTURE_BYTES = WIDTH * HEIGHT * 3 / 2 };

extern const double FRAME_RATE; /* Hz */

typedef struct {
    double position[AXES]; /* m */
    double velocity[AXES]; /* m/s, measured */
    double force[AXES];    /* N, of the edge springs */
    volatile sig_atomic_t resting; /* brought to rest by the watchdog: the tick that hung moves nothing any more */
} robot;

void robot_tick(robot *of, const double *values, double dt);
/* Called in the middle of anything, also of robot_tick. With motors: a write(2) that tells them to stop. */
void robot_rest(robot *of);
bool robot_at_rest(const robot *of);
void pack_description(buffer *to);
/* Draws what the camera above the table sees as planes Y, U, V; the event stands in a strip of cells at the top. */
void robot_draw(const robot *of, uint32_t event, uint8_t picture[PICTURE_BYTES]);

#endif
