#include "robot.h"

#include <math.h>
#include <string.h>

#include "watchdog.h"

const double HOLD = 0.3, MAX_EVENT_AGE = 2.0, FRAME_RATE = 20.0;
const double FASTEST[AXES] = {0.4, 0.3}, SLEW[AXES] = {1.6, 1.2}, BRAKE[AXES] = {4.0, 3.0};

static const double HALF_TABLE[AXES] = {0.5, 0.35}; /* m */
static const double SPRING = 400.0;                 /* N/m, from 3 cm before the edge on */
static const double SOFT = 0.03;                    /* m */
static const char *const AXIS_NAMES[AXES] = {"carriage.vx", "carriage.vy"};
static const char *const AXIS_LABELS[AXES] = {"Forward", "Left"};
static const char *const JOINT_NAMES[AXES] = {"carriage.x", "carriage.y"};

void robot_rest(robot *of) { of->resting = 1; }

void robot_tick(robot *of, const double *values, double dt) {
    for (int i = 0; i < AXES; i++) {
        double before = of->position[i], edge = HALF_TABLE[i], value = of->resting ? 0 : values[i];
        of->position[i] = fmin(fmax(before + value * dt, -edge), edge);
        of->velocity[i] = (of->position[i] - before) / dt;
        double pressed = fmax(fabs(of->position[i]) - (edge - SOFT), 0);
        of->force[i] = -copysign(SPRING * pressed, of->position[i]);
    }
    of->resting = 0;
}

bool robot_at_rest(const robot *of) { return fabs(of->velocity[0]) < 1e-3 && fabs(of->velocity[1]) < 1e-3; }

static void text_field(buffer *to, const char *key, const char *text) {
    pack_str(to, key);
    pack_str(to, text);
}

static void number_field(buffer *to, const char *key, double number) {
    pack_str(to, key);
    pack_float(to, number);
}

static void vector_field(buffer *to, const char *key, double x, double y, double z) {
    pack_str(to, key);
    pack_array(to, 3);
    pack_float(to, x);
    pack_float(to, y);
    pack_float(to, z);
}

static void pack_axes(buffer *to) {
    pack_str(to, "axes");
    pack_array(to, AXES);
    for (int i = 0; i < AXES; i++) {
        pack_map(to, 7);
        text_field(to, "name", AXIS_NAMES[i]);
        text_field(to, "label", AXIS_LABELS[i]);
        text_field(to, "unit", "m/s");
        number_field(to, "minimum", -FASTEST[i]);
        number_field(to, "maximum", FASTEST[i]);
        number_field(to, "slew", SLEW[i]);
        number_field(to, "brake", BRAKE[i]);
    }
}

static void pack_joints(buffer *to) {
    pack_str(to, "joints");
    pack_array(to, AXES);
    for (int i = 0; i < AXES; i++) {
        pack_map(to, 4);
        text_field(to, "name", JOINT_NAMES[i]);
        text_field(to, "unit", "m");
        number_field(to, "minimum", -HALF_TABLE[i]);
        number_field(to, "maximum", HALF_TABLE[i]);
    }
}

/* The left stick moves the carriage. Pads say up and left with negative numbers, touch sticks only left. */
static void pack_layers(buffer *to) {
    static const char *const STICKS[AXES] = {"left_y", "left_x"};
    static const char *const KEYS[AXES][2] = {{"KeyW", "KeyS"}, {"KeyA", "KeyD"}};
    pack_str(to, "layers");
    pack_array(to, 1);
    pack_map(to, 3);
    text_field(to, "name", "carriage");
    text_field(to, "label", "Carriage");
    pack_str(to, "bindings");
    pack_array(to, AXES);
    for (int i = 0; i < AXES; i++) {
        pack_map(to, 7);
        text_field(to, "axis", AXIS_NAMES[i]);
        text_field(to, "pad", STICKS[i]);
        text_field(to, "touch", STICKS[i]);
        pack_str(to, "invert_pad");
        pack_bool(to, true);
        pack_str(to, "invert_touch");
        pack_bool(to, i == 1);
        text_field(to, "key_positive", KEYS[i][0]);
        text_field(to, "key_negative", KEYS[i][1]);
    }
}

static void pack_box(buffer *to, double x, double y, double z, double up, double grey) {
    pack_str(to, "geoms");
    pack_array(to, 1);
    pack_map(to, 4);
    text_field(to, "shape", "box");
    vector_field(to, "size", x, y, z);
    vector_field(to, "position", 0, 0, up);
    pack_str(to, "rgba");
    pack_array(to, 4);
    pack_float(to, grey);
    pack_float(to, grey);
    pack_float(to, 0.7);
    pack_float(to, 1);
}

static void pack_bodies(buffer *to) {
    pack_str(to, "bodies");
    pack_array(to, 2);
    pack_map(to, 3);
    text_field(to, "name", "table");
    text_field(to, "parent", "");
    pack_box(to, HALF_TABLE[0] + 0.05, HALF_TABLE[1] + 0.05, 0.01, -0.01, 0.3);
    pack_map(to, 4);
    text_field(to, "name", "carriage");
    text_field(to, "parent", "");
    pack_str(to, "joints");
    pack_array(to, AXES);
    for (int i = 0; i < AXES; i++) {
        pack_map(to, 3);
        text_field(to, "joint", JOINT_NAMES[i]);
        text_field(to, "kind", "prismatic");
        vector_field(to, "axis", i == 0, i == 1, 0);
    }
    pack_box(to, 0.05, 0.05, 0.03, 0.03, 0.8);
}

void pack_description(buffer *to) {
    pack_map(to, 12);
    text_field(to, "name", "table-in-c");
    text_field(to, "label", "Carriage on a table (in C)");
    pack_axes(to);
    pack_joints(to);
    pack_layers(to);
    pack_bodies(to);
    pack_str(to, "cameras");
    pack_array(to, 1);
    pack_map(to, 5);
    text_field(to, "name", "above");
    text_field(to, "label", "From above");
    pack_str(to, "width");
    pack_int(to, WIDTH);
    pack_str(to, "height");
    pack_int(to, HEIGHT);
    number_field(to, "frame_rate", FRAME_RATE);
    pack_str(to, "wrench");
    pack_map(to, 5);
    text_field(to, "name", "springs");
    text_field(to, "body", "carriage");
    number_field(to, "threshold_force", 0.5);
    number_field(to, "full_scale_force", 12);
    number_field(to, "full_scale_torque", 1);
    number_field(to, "hold", HOLD);
    number_field(to, "watchdog", WATCHDOG);
    number_field(to, "max_event_age", MAX_EVENT_AGE);
    number_field(to, "max_event_rate", 25);
}

static void fill(uint8_t *picture, int left, int top, int right, int bottom, const uint8_t yuv[3]) {
    uint8_t *u = picture + WIDTH * HEIGHT, *v = u + WIDTH * HEIGHT / 4;
    for (int y = top < 0 ? 0 : top; y < bottom && y < HEIGHT; y++)
        for (int x = left < 0 ? 0 : left; x < right && x < WIDTH; x++) {
            picture[y * WIDTH + x] = yuv[0];
            u[y / 2 * (WIDTH / 2) + x / 2] = yuv[1];
            v[y / 2 * (WIDTH / 2) + x / 2] = yuv[2];
        }
}

void robot_draw(const robot *of, uint32_t event, uint8_t picture[PICTURE_BYTES]) {
    static const uint8_t FLOOR[3] = {50, 128, 128}, TABLE[3] = {95, 122, 134}, LINE[3] = {115, 122, 134};
    static const uint8_t CARRIAGE[3] = {160, 160, 80}, PRESSED[3] = {110, 100, 210};
    static const uint8_t BLACK[3] = {16, 128, 128}, WHITE[3] = {235, 128, 128};
    const double scale = 240.0; /* pixels to the metre */
    const int cx = WIDTH / 2, cy = HEIGHT / 2 + 6;
    int half_x = (int)((HALF_TABLE[1] + 0.05) * scale), half_y = (int)((HALF_TABLE[0] + 0.05) * scale) - 24;
    fill(picture, 0, 0, WIDTH, HEIGHT, FLOOR);
    fill(picture, cx - half_x, cy - half_y, cx + half_x, cy + half_y, TABLE);
    for (int line = -2; line <= 2; line++) {
        fill(picture, cx + line * 40, cy - half_y, cx + line * 40 + 2, cy + half_y, LINE);
        fill(picture, cx - half_x, cy + line * 40, cx + half_x, cy + line * 40 + 2, LINE);
    }
    /* x is forward, which is up in the picture; y is to the left. */
    int x = cx - (int)lround(of->position[1] * scale);
    int y = cy - (int)lround(of->position[0] * (half_y - 10) / HALF_TABLE[0]);
    bool pressed = of->force[0] != 0 || of->force[1] != 0;
    fill(picture, x - 10, y - 10, x + 10, y + 10, pressed ? PRESSED : CARRIAGE);
    /* 31 bits of the event, the highest first, then their parity. */
    bool parity = false;
    for (int cell = 0; cell < 32; cell++) {
        bool bit = cell < 31 ? event >> (30 - cell) & 1 : parity;
        parity = parity != bit;
        fill(picture, cell * WIDTH / 32, 0, (cell + 1) * WIDTH / 32, HEIGHT / 20, bit ? WHITE : BLACK);
    }
}
