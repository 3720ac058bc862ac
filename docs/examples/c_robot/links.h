/* Connections: frames, handshake, roles, heartbeats, and what waits for a client that reads slowly. */
#ifndef LINKS_H
#define LINKS_H

#include "message.h"

enum { MAX_LINKS = 32, MAX_STRANGERS = 16 };

typedef struct peer peer;

/* What the links ask of the robot. */
typedef struct {
    void (*opened)(role);                   /* a link of this role is there */
    void (*said)(peer *, const message *);  /* a message that its sender may send */
    void (*bad)(peer *, uint32_t event, const char *reason); /* a malformed or forbidden one */
    void (*operator_lost)(void);
} handler;

/* Listens on loopback; `*port` 0 takes any free one, and is set. False: errno says why. */
bool links_listen(int *port, const handler *to, const char *epoch);
/* Waits for at most `timeout` s, reads, hands over what came, sends what waits. `now` is asked for the time. */
void links_serve(double timeout, double (*now)(void));
void links_close(double (*now)(void));

/* `stop`: that a refused reset named; 0 for anything else. */
void send_refusal(peer *to, uint32_t event, const char *reason, uint32_t current, uint64_t stop);
void send_stop_taken(peer *to, const char *press, uint64_t number, bool kept);
/* A frame for one peer, or for all of a role; it takes the place of an older one that still waits. */
void send_feedback(peer *to, const buffer *frame);
void publish(role to, const buffer *frame);

#endif
