#include "message.h"

#include <string.h>

/* Which fields came, as bits. */
enum { F_TYPE = 1, F_ROLE = 2, F_EVENT = 4, F_ISSUE = 8, F_VALUES = 16, F_ID = 32, F_ERROR = 64 };

static const struct {
    const char *name;
    message_type type;
    int needs;
} TYPES[] = {
    {"hello", HELLO, F_ROLE}, {"command", COMMAND, F_EVENT | F_ISSUE | F_VALUES}, {"rest", REST, F_EVENT},
    {"stop", STOP, 0}, {"reset", RESET, 0}, {"ping", PING, F_ID}, {"pong", PONG, F_ID}, {"goodbye", GOODBYE, F_ERROR},
    {"challenge", OTHERS, 0}, {"stop_taken", OTHERS, 0}, {"feedback", OTHERS, 0}, {"refusal", OTHERS, 0}, {"event", OTHERS, 0}, {"media", OTHERS, 0},
};

static int find_type(const value *text) {
    for (size_t i = 0; i < sizeof TYPES / sizeof *TYPES; i++)
        if (is_text(text, TYPES[i].name)) return (int)i;
    return -1;
}

/* The map's value for a key; false when there is none. What stands behind the map is looked at by the caller. */
static bool find_key(const uint8_t *bytes, size_t size, const char *key, value *found) {
    reader from = {bytes, bytes + size};
    value map, name;
    if (!read_value(&from, &map) || map.kind != MAP) return false;
    for (uint32_t i = 0; i < map.size; i++) {
        if (!read_value(&from, &name) || name.kind != STR) return false;
        if (is_text(&name, key)) return read_value(&from, found);
        if (!skip_value(&from)) return false;
    }
    return false;
}

static role find_role(const value *text) {
    if (is_text(text, "operator")) return OPERATOR;
    if (is_text(text, "events")) return EVENTS;
    if (is_text(text, "media")) return MEDIA;
    return ANOTHER_ROLE;
}

static bool read_values(reader *from, const value *array, message *found) {
    if (array->kind != ARRAY || array->size > MAX_VALUES) return false;
    for (found->count = 0; found->count < array->size; found->count++) {
        value number;
        if (!read_value(from, &number) || (number.kind != INT && number.kind != FLOAT)) return false;
        found->values[found->count] = number.number;
    }
    return true;
}

/* From 0 to 2^53 - 1: nonces and numbers of stops. */
static bool read_number(const value *field, uint64_t *number) {
    if (field->kind != INT || field->integer < 0 || field->integer >= INT64_C(1) << 53) return false;
    *number = (uint64_t)field->integer;
    return true;
}

/* Of a string that is UTF-8. */
static size_t characters_of(const char *text) {
    size_t count = 0;
    for (; *text != '\0'; text++) count += (*text & 0xc0) != 0x80;
    return count;
}

/* One field of a message of this type; `has` gets its bit. Fields that this type does not have are passed over. */
static bool read_field(reader *from, const value *key, message *found, int *has) {
    message_type type = found->type;
    char text[2001];
    value field;
    if (!read_value(from, &field)) return false;
    if (is_text(key, "version") && type == HELLO) {
        found->versioned = field.integer == 2;
        return field.kind == INT;
    }
    if (is_text(key, "role") && type == HELLO) {
        found->role = find_role(&field);
        *has |= F_ROLE;
        return field.kind == STR;
    }
    if ((is_text(key, "nonce") || is_text(key, "proof")) && type == HELLO) return field.kind == BIN && field.size <= 64;
    if ((is_text(key, "name") || is_text(key, "epoch")) && type == HELLO) return copy_text(&field, text);
    if (is_text(key, "event") && (type == COMMAND || type == REST)) {
        if (field.kind != INT || field.integer < 1 || field.integer > 0x7fffffff) return false;
        found->event = (uint32_t)field.integer;
        *has |= F_EVENT;
        return true;
    }
    if (is_text(key, "issue") && type == COMMAND) {
        found->issue = (uint64_t)field.integer;
        *has |= F_ISSUE;
        return field.kind == INT && field.integer >= 1;
    }
    if (is_text(key, "nonce") && type == COMMAND) return read_number(&field, &found->nonce);
    if (is_text(key, "number") && type == RESET) return read_number(&field, &found->number);
    if (is_text(key, "press") && type == STOP) {
        bool good = copy_text(&field, text) && characters_of(text) <= 64;
        if (good) strcpy(found->press, text);
        return good;
    }
    if (is_text(key, "values") && type == COMMAND) {
        *has |= F_VALUES;
        return read_values(from, &field, found);
    }
    if (is_text(key, "by") && (type == STOP || type == RESET)) return copy_text(&field, found->by);
    if (is_text(key, "reason") && type == STOP) return copy_text(&field, found->reason);
    if (is_text(key, "id") && (type == PING || type == PONG)) {
        found->id = field.integer;
        *has |= F_ID;
        return field.kind == INT;
    }
    if (is_text(key, "error") && type == GOODBYE) {
        *has |= F_ERROR;
        return copy_text(&field, text);
    }
    return skip_inside(from, &field);
}

bool parse_message(const uint8_t *bytes, size_t size, message *found) {
    reader from = {bytes, bytes + size};
    value type, map, key, event;
    int which, has = 0;
    memset(found, 0, sizeof *found);
    found->versioned = true; /* unless it says otherwise */
    if (!find_key(bytes, size, "type", &type) || (which = find_type(&type)) < 0) return false;
    found->type = TYPES[which].type;
    bool numbered = found->type == COMMAND && find_key(bytes, size, "event", &event) && event.kind == INT
                    && event.integer >= 1 && event.integer <= 0x7fffffff;
    if (numbered) found->event = (uint32_t)event.integer;
    read_value(&from, &map);
    for (uint32_t i = 0; i < map.size; i++)
        if (!read_value(&from, &key) || key.kind != STR || !read_field(&from, &key, found, &has)) return false;
    return from.at == from.end && (has & TYPES[which].needs) == TYPES[which].needs;
}
