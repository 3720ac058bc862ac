/* MessagePack, as much of it as the robot link needs. Reading never goes beyond the bytes that are there. */
#ifndef PACK_H
#define PACK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* A growing buffer of bytes to send. */
typedef struct {
    uint8_t *data;
    size_t size, capacity;
} buffer;

void append(buffer *to, const void *bytes, size_t size);
void drop_front(buffer *of, size_t size);
void release(buffer *of);

void pack_nil(buffer *to);
void pack_bool(buffer *to, bool value);
void pack_int(buffer *to, int64_t value);
void pack_float(buffer *to, double value);
void pack_str(buffer *to, const char *text);
void pack_bin(buffer *to, const void *bytes, size_t size);
void pack_array(buffer *to, uint32_t count);
void pack_map(buffer *to, uint32_t count);

/* A frame: its length of four bytes, then the message that is packed between these two. */
size_t begin_frame(buffer *to);
void end_frame(buffer *to, size_t begun);

typedef struct {
    const uint8_t *at, *end;
} reader;

typedef enum { NIL, BOOL, INT, FLOAT, STR, BIN, ARRAY, MAP, EXT } kind;

typedef struct {
    kind kind;
    bool boolean;
    int64_t integer;      /* of INT; the nearest that fits */
    double number;        /* of INT and FLOAT */
    const uint8_t *bytes; /* of STR, BIN and EXT */
    uint32_t size;        /* of those, or the number of elements (ARRAY) or of pairs (MAP) that follow */
} value;

/* The next value; elements of arrays and maps follow as values of their own. False: not MessagePack, or cut off. */
bool read_value(reader *from, value *found);
/* Passes over the next value with all that is in it. */
bool skip_value(reader *from);
/* Passes over what follows a value that was read. */
bool skip_inside(reader *from, const value *of);

/* Whether it is a string of this text. */
bool is_text(const value *of, const char *text);
/* Copies a string of at most 500 characters. False: another kind, too long, or not UTF-8. */
bool copy_text(const value *of, char to[2001]);

#endif
