#include "pack.h"

#include <stdlib.h>
#include <string.h>

void append(buffer *to, const void *bytes, size_t size) {
    if (to->size + size > to->capacity) {
        size_t capacity = 2 * (to->size + size);
        uint8_t *data = realloc(to->data, capacity);
        if (data == NULL) abort(); /* a robot without memory must not go on */
        to->data = data;
        to->capacity = capacity;
    }
    if (size > 0) memcpy(to->data + to->size, bytes, size);
    to->size += size;
}

void drop_front(buffer *of, size_t size) {
    if (size > 0 && size < of->size) memmove(of->data, of->data + size, of->size - size);
    of->size -= size;
}

void release(buffer *of) {
    free(of->data);
    memset(of, 0, sizeof *of);
}

static void put_number(buffer *to, uint8_t tag, uint64_t number, int bytes) {
    uint8_t out[9] = {tag};
    for (int i = 0; i < bytes; i++) out[1 + i] = (uint8_t)(number >> (8 * (bytes - 1 - i)));
    append(to, out, 1 + (size_t)bytes);
}

void pack_nil(buffer *to) { append(to, "\xc0", 1); }

void pack_bool(buffer *to, bool value) { append(to, value ? "\xc3" : "\xc2", 1); }

void pack_int(buffer *to, int64_t value) { put_number(to, 0xd3, (uint64_t)value, 8); }

void pack_float(buffer *to, double value) {
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    put_number(to, 0xcb, bits, 8);
}

void pack_str(buffer *to, const char *text) {
    size_t size = strlen(text);
    put_number(to, 0xdb, size, 4);
    append(to, text, size);
}

void pack_bin(buffer *to, const void *bytes, size_t size) {
    put_number(to, 0xc6, size, 4);
    append(to, bytes, size);
}

void pack_array(buffer *to, uint32_t count) { put_number(to, 0xdd, count, 4); }

void pack_map(buffer *to, uint32_t count) { put_number(to, 0xdf, count, 4); }

size_t begin_frame(buffer *to) {
    append(to, "\0\0\0\0", 4);
    return to->size;
}

void end_frame(buffer *to, size_t begun) {
    size_t size = to->size - begun;
    for (int i = 0; i < 4; i++) to->data[begun - 4 + (size_t)i] = (uint8_t)(size >> (8 * (3 - i)));
}

/* An unsigned number of 1, 2, 4 or 8 bytes, big-endian. */
static bool take_number(reader *from, int bytes, uint64_t *number) {
    if (from->end - from->at < bytes) return false;
    *number = 0;
    for (int i = 0; i < bytes; i++) *number = *number << 8 | *from->at++;
    return true;
}

static bool take_bytes(reader *from, value *found, kind kind, uint64_t size) {
    if ((uint64_t)(from->end - from->at) < size) return false;
    found->kind = kind;
    found->bytes = from->at;
    found->size = (uint32_t)size;
    from->at += size;
    return true;
}

/* Elements have at least a byte each, so a count beyond the bytes that are left is a lie. */
static bool take_count(reader *from, value *found, kind kind, uint64_t count) {
    if (count * (kind == MAP ? 2 : 1) > (uint64_t)(from->end - from->at)) return false;
    found->kind = kind;
    found->size = (uint32_t)count;
    return true;
}

static bool take_unsigned(value *found, uint64_t number) {
    found->kind = INT;
    found->integer = number > INT64_MAX ? INT64_MAX : (int64_t)number;
    found->number = (double)number;
    return true;
}

static bool take_signed(value *found, int64_t number) {
    found->kind = INT;
    found->integer = number;
    found->number = (double)number;
    return true;
}

static bool take_float(reader *from, value *found, int bytes) {
    uint64_t bits;
    if (!take_number(from, bytes, &bits)) return false;
    found->kind = FLOAT;
    if (bytes == 4) {
        uint32_t narrow = (uint32_t)bits;
        float number;
        memcpy(&number, &narrow, sizeof number);
        found->number = number;
    } else {
        memcpy(&found->number, &bits, sizeof bits);
    }
    return true;
}

bool read_value(reader *from, value *found) {
    uint64_t number;
    memset(found, 0, sizeof *found);
    if (from->at == from->end) return false;
    uint8_t tag = *from->at++;
    if (tag <= 0x7f) return take_unsigned(found, tag);
    if (tag <= 0x8f) return take_count(from, found, MAP, tag & 0x0f);
    if (tag <= 0x9f) return take_count(from, found, ARRAY, tag & 0x0f);
    if (tag <= 0xbf) return take_bytes(from, found, STR, tag & 0x1f);
    if (tag >= 0xe0) return take_signed(found, (int64_t)tag - 256);
    switch (tag) {
    case 0xc0: found->kind = NIL; return true;
    case 0xc2: case 0xc3: found->kind = BOOL; found->boolean = tag == 0xc3; return true;
    case 0xc4: case 0xc5: case 0xc6:
        return take_number(from, 1 << (tag - 0xc4), &number) && take_bytes(from, found, BIN, number);
    case 0xc7: case 0xc8: case 0xc9: /* one more byte tells the kind of extension */
        return take_number(from, 1 << (tag - 0xc7), &number) && take_bytes(from, found, EXT, number + 1);
    case 0xca: return take_float(from, found, 4);
    case 0xcb: return take_float(from, found, 8);
    case 0xcc: case 0xcd: case 0xce: case 0xcf:
        return take_number(from, 1 << (tag - 0xcc), &number) && take_unsigned(found, number);
    case 0xd0: return take_number(from, 1, &number) && take_signed(found, (int8_t)number);
    case 0xd1: return take_number(from, 2, &number) && take_signed(found, (int16_t)number);
    case 0xd2: return take_number(from, 4, &number) && take_signed(found, (int32_t)number);
    case 0xd3: return take_number(from, 8, &number) && take_signed(found, (int64_t)number);
    case 0xd4: case 0xd5: case 0xd6: case 0xd7: case 0xd8:
        return take_bytes(from, found, EXT, (UINT64_C(1) << (tag - 0xd4)) + 1);
    case 0xd9: case 0xda: case 0xdb:
        return take_number(from, 1 << (tag - 0xd9), &number) && take_bytes(from, found, STR, number);
    case 0xdc: case 0xdd:
        return take_number(from, 2 << (tag - 0xdc), &number) && take_count(from, found, ARRAY, number);
    case 0xde: case 0xdf:
        return take_number(from, 2 << (tag - 0xde), &number) && take_count(from, found, MAP, number);
    default: return false; /* 0xc1 is never used */
    }
}

bool skip_inside(reader *from, const value *of) {
    uint64_t left = of->kind == ARRAY ? of->size : of->kind == MAP ? 2 * (uint64_t)of->size : 0;
    for (; left > 0; left--) {
        value inner;
        if (!read_value(from, &inner)) return false;
        if (inner.kind == ARRAY) left += inner.size;
        if (inner.kind == MAP) left += 2 * (uint64_t)inner.size;
    }
    return true;
}

bool skip_value(reader *from) {
    value found;
    return read_value(from, &found) && skip_inside(from, &found);
}

bool is_text(const value *of, const char *text) {
    return of->kind == STR && of->size == strlen(text) && memcmp(of->bytes, text, of->size) == 0;
}

/* How many bytes the UTF-8 character has that begins here; 0 when it is none (RFC 3629). */
static size_t character(const uint8_t *at, size_t left) {
    uint8_t first = at[0];
    size_t size = first < 0x80 ? 1 : first >= 0xc2 && first < 0xe0 ? 2 : first >= 0xe0 && first < 0xf0 ? 3
                : first >= 0xf0 && first < 0xf5 ? 4 : 0;
    if (size == 0 || size > left) return 0;
    for (size_t i = 1; i < size; i++)
        if ((at[i] & 0xc0) != 0x80) return 0;
    if ((first == 0xe0 && at[1] < 0xa0) || (first == 0xf0 && at[1] < 0x90)) return 0; /* longer than need be */
    if ((first == 0xed && at[1] > 0x9f) || (first == 0xf4 && at[1] > 0x8f)) return 0; /* surrogates, too large */
    return size;
}

bool copy_text(const value *of, char to[2001]) {
    size_t characters = 0;
    if (of->kind != STR || of->size > 2000) return false;
    for (size_t at = 0; at < of->size; characters++) {
        size_t size = character(of->bytes + at, of->size - at);
        if (size == 0 || characters == 500) return false;
        at += size;
    }
    memcpy(to, of->bytes, of->size);
    to[of->size] = '\0';
    return true;
}
