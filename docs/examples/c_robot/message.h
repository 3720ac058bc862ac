/* What clients say (docs/robot-link.md, "Messages"). */
#ifndef MESSAGE_H
#define MESSAGE_H

#include "pack.h"

enum { MAX_VALUES = 256 };

typedef enum { HELLO, COMMAND, REST, STOP, RESET, PING, PONG, GOODBYE, OTHERS } message_type;
typedef enum { NO_ROLE, OPERATOR, EVENTS, MEDIA, ANOTHER_ROLE } role;

typedef struct {
    message_type type;
    bool versioned;        /* hello: speaks version 2 */
    role role;             /* hello */
    uint32_t event;        /* command, rest */
    uint64_t issue;        /* command */
    double values[MAX_VALUES];
    size_t count;
    uint64_t nonce;        /* command */
    char by[2001], reason[2001];
    char press[257];       /* stop */
    uint64_t number;       /* reset: of the newest stop that the sender has seen */
    int64_t id;            /* ping, pong */
} message;

/* False: the bytes are not one message of the protocol. `found->event` is then the event of a command as far as it
 * could be read, and 0 otherwise. */
bool parse_message(const uint8_t *bytes, size_t size, message *found);

#endif
