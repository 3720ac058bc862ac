/* The robot itself: a carriage on a table, two axes, with springs at the table's edges. */
#ifndef ROBOT_H
#define ROBOT_H

#include "events.h"
#include "pack.h"

enum { WIDTH = 320, HEIGHT = 240, PICTURE_BYTES = WIDTH * HEIGHT * 3 / 2 };

extern const double FRAME_RATE; /* Hz */

typedef struct {
    double position[AXES]; /* m */
    double velocity[AXES]; /* m/s, measured */
    double force[AXES];    /* N, of the edge springs */
} robot;

void robot_tick(robot *of, const double *values, double dt);
bool robot_at_rest(const robot *of);
void pack_description(buffer *to);
/* Draws what the camera above the table sees as planes Y, U, V; the event stands in a strip of cells at the top. */
void robot_draw(const robot *of, uint32_t event, uint8_t picture[PICTURE_BYTES]);

#endif
