#include "links.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "robot.h"

static const double PING_INTERVAL = 0.2, SILENCE = 1.0, HELLO_TIMEOUT = 2.0, STALLED = 1.0, FAREWELL = 1.0;
static const size_t MAX_HELLO = 8 << 10, MAX_CONTROL = 1 << 20;

/* What may wait for a client, in the order in which it goes out: the newest of each. */
enum { W_HELLO, W_PONG, W_PING, W_TAKEN, W_REFUSAL, W_NEWS, WAITING };

struct peer {
    int fd;                  /* -1: free */
    role role;               /* NO_ROLE: not admitted yet */
    bool leaving;            /* goodbye was said: nothing is read any more */
    double opened, heard, pinged;
    double moved;            /* when a byte was last taken by the client, or there was none for it */
    buffer in;               /* received and not yet a whole frame */
    buffer out;              /* the frame that is being sent */
    size_t sent;             /* of it */
    buffer waiting[WAITING]; /* a frame each; W_NEWS is feedback, event notice or picture, by role */
};

static peer all[MAX_LINKS + MAX_STRANGERS];
static int listener = -1;
static const handler *robot_side;
static const char *own_epoch;
static int64_t ping_id;
static double served; /* when the links were last looked after */

static void wait_with(peer *of, int what, const buffer *frame) {
    of->waiting[what].size = 0;
    append(&of->waiting[what], frame->data, frame->size);
}

static void drop(peer *of) {
    role was = of->role;
    close(of->fd);
    release(&of->in);
    release(&of->out);
    for (int i = 0; i < WAITING; i++) release(&of->waiting[i]);
    memset(of, 0, sizeof *of);
    of->fd = -1;
    if (was == OPERATOR) robot_side->operator_lost();
}

/* Always the last message; the link is closed once it is out, or after a while. */
static void say_goodbye(peer *of, const char *error, double now) {
    if (of->leaving) return;
    buffer frame = {0};
    size_t begun = begin_frame(&frame);
    pack_map(&frame, 2);
    pack_str(&frame, "type");
    pack_str(&frame, "goodbye");
    pack_str(&frame, "error");
    pack_str(&frame, error);
    end_frame(&frame, begun);
    for (int i = 0; i < WAITING; i++) of->waiting[i].size = 0;
    wait_with(of, W_NEWS, &frame);
    release(&frame);
    if (of->role == OPERATOR) robot_side->operator_lost();
    of->role = NO_ROLE;
    of->leaving = true;
    of->opened = now;
}

static void send_heartbeat(peer *of, int what, const char *type, int64_t id) {
    buffer frame = {0};
    size_t begun = begin_frame(&frame);
    pack_map(&frame, 2);
    pack_str(&frame, "type");
    pack_str(&frame, type);
    pack_str(&frame, "id");
    pack_int(&frame, id);
    end_frame(&frame, begun);
    wait_with(of, what, &frame);
    release(&frame);
}

static void send_hello(peer *of) {
    buffer frame = {0};
    size_t begun = begin_frame(&frame);
    pack_map(&frame, 6);
    pack_str(&frame, "type");
    pack_str(&frame, "hello");
    pack_str(&frame, "version");
    pack_int(&frame, 2);
    pack_str(&frame, "role");
    pack_str(&frame, "robot");
    pack_str(&frame, "name");
    pack_str(&frame, "robot in C");
    pack_str(&frame, "epoch");
    pack_str(&frame, own_epoch);
    pack_str(&frame, "description");
    if (of->role == EVENTS) pack_nil(&frame);
    else pack_description(&frame);
    end_frame(&frame, begun);
    wait_with(of, W_HELLO, &frame);
    release(&frame);
}

void send_refusal(peer *to, uint32_t event, const char *reason, uint32_t current, uint64_t stop) {
    buffer frame = {0};
    size_t begun = begin_frame(&frame);
    pack_map(&frame, 5);
    pack_str(&frame, "type");
    pack_str(&frame, "refusal");
    pack_str(&frame, "event");
    pack_int(&frame, event);
    pack_str(&frame, "reason");
    pack_str(&frame, reason);
    pack_str(&frame, "current");
    pack_int(&frame, current);
    pack_str(&frame, "stop");
    pack_int(&frame, (int64_t)stop);
    end_frame(&frame, begun);
    wait_with(to, W_REFUSAL, &frame);
    release(&frame);
}

void send_stop_taken(peer *to, const char *press, uint64_t number, bool kept) {
    buffer frame = {0};
    size_t begun = begin_frame(&frame);
    pack_map(&frame, 4);
    pack_str(&frame, "type");
    pack_str(&frame, "stop_taken");
    pack_str(&frame, "press");
    pack_str(&frame, press);
    pack_str(&frame, "number");
    pack_int(&frame, (int64_t)number);
    pack_str(&frame, "kept");
    pack_bool(&frame, kept);
    end_frame(&frame, begun);
    wait_with(to, W_TAKEN, &frame);
    release(&frame);
}

void send_feedback(peer *to, const buffer *frame) { wait_with(to, W_NEWS, frame); }

void publish(role to, const buffer *frame) {
    for (int i = 0; i < MAX_LINKS + MAX_STRANGERS; i++)
        if (all[i].fd >= 0 && all[i].role == to) wait_with(&all[i], W_NEWS, frame);
}

static void admit(peer *of, const message *hello, double now) {
    int operators = 0, admitted = 0;
    for (int i = 0; i < MAX_LINKS + MAX_STRANGERS; i++) {
        admitted += all[i].fd >= 0 && all[i].role != NO_ROLE;
        operators += all[i].fd >= 0 && all[i].role == OPERATOR;
    }
    if (hello->type != HELLO) say_goodbye(of, "handshake", now);
    else if (!hello->versioned) say_goodbye(of, "version", now);
    else if (hello->role == ANOTHER_ROLE) say_goodbye(of, "role", now);
    else if (admitted - operators >= MAX_LINKS - (hello->role != OPERATOR)) say_goodbye(of, "full", now);
    else if (hello->role == OPERATOR && operators > 0) say_goodbye(of, "taken", now);
    else {
        of->role = hello->role;
        send_hello(of);
        robot_side->opened(of->role);
    }
}

static bool may_say(role who, message_type what) {
    if (what == STOP || what == PING || what == PONG || what == GOODBYE) return true;
    return who == OPERATOR && (what == COMMAND || what == REST || what == RESET);
}

static void take_frame(peer *of, const uint8_t *bytes, size_t size, double now) {
    static message found; /* large */
    bool good = parse_message(bytes, size, &found);
    if (of->role == NO_ROLE) {
        if (good) of->heard = now;
        if (good) admit(of, &found, now);
        else say_goodbye(of, "handshake", now);
    } else if (!good) {
        robot_side->bad(of, found.event, "malformed");
    } else if (!may_say(of->role, found.type)) {
        robot_side->bad(of, found.type == COMMAND ? found.event : 0, "not_allowed");
    } else {
        of->heard = now;
        if (found.type == PING) send_heartbeat(of, W_PONG, "pong", found.id);
        else if (found.type == GOODBYE) drop(of);
        else if (found.type != PONG) robot_side->said(of, &found);
    }
}

static void take_frames(peer *of, double now) {
    size_t at = 0;
    while (of->fd >= 0 && !of->leaving && of->in.size - at >= 4) {
        const uint8_t *head = of->in.data + at;
        size_t size = (size_t)head[0] << 24 | (size_t)head[1] << 16 | (size_t)head[2] << 8 | head[3];
        if (size == 0 || size > (of->role == NO_ROLE ? MAX_HELLO : MAX_CONTROL)) {
            say_goodbye(of, "framing", now);
        } else {
            if (of->in.size - at - 4 < size) break;
            at += 4 + size;
            take_frame(of, head + 4, size, now);
        }
    }
    if (of->fd >= 0) drop_front(&of->in, of->leaving ? of->in.size : at);
}

static void receive(peer *of, double now) {
    uint8_t bytes[16384];
    ssize_t count = recv(of->fd, bytes, sizeof bytes, 0);
    if (count == 0 || (count < 0 && errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR)) {
        drop(of);
    } else if (count > 0 && !of->leaving) {
        append(&of->in, bytes, (size_t)count);
        take_frames(of, now);
    }
}

/* Moves the next frame that waits to where it is sent from. */
static bool next_frame(peer *of) {
    for (int i = 0; i < WAITING; i++)
        if (of->waiting[i].size > 0) {
            buffer taken = of->waiting[i];
            of->waiting[i] = of->out;
            of->waiting[i].size = 0;
            of->out = taken;
            of->sent = 0;
            return true;
        }
    return false;
}

static bool has_output(const peer *of) {
    for (int i = 0; i < WAITING; i++)
        if (of->waiting[i].size > 0) return true;
    return of->sent < of->out.size;
}

static void transmit(peer *of, double now) {
    if (!has_output(of)) of->moved = now;
    while (of->sent < of->out.size || next_frame(of)) {
        ssize_t count = send(of->fd, of->out.data + of->sent, of->out.size - of->sent, MSG_NOSIGNAL);
        if (count < 0) {
            if (errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR) drop(of);
            return;
        }
        of->moved = now;
        of->sent += (size_t)count;
    }
    if (of->leaving) drop(of);
}

static void look_after(peer *of, double now) {
    if (of->leaving) {
        if (now - of->opened > FAREWELL) drop(of);
        return;
    }
    if (now - of->moved > STALLED) {
        drop(of);
    } else if (of->role == NO_ROLE) {
        if (now - of->opened > HELLO_TIMEOUT) say_goodbye(of, "silent", now);
    } else if (now - of->heard > SILENCE) {
        say_goodbye(of, "silent", now);
    } else if (now - of->pinged >= PING_INTERVAL) {
        of->pinged = now;
        send_heartbeat(of, W_PING, "ping", ++ping_id);
    }
}

static void welcome(double now) {
    int fd = accept(listener, NULL, NULL), one = 1, strangers = 0;
    peer *place = NULL, *oldest = NULL;
    if (fd < 0) return;
    for (int i = 0; i < MAX_LINKS + MAX_STRANGERS; i++) {
        peer *of = &all[i];
        if (of->fd < 0) place = of;
        else if (of->role == NO_ROLE) {
            strangers++;
            if (oldest == NULL || of->opened < oldest->opened) oldest = of;
        }
    }
    if (strangers >= MAX_STRANGERS || place == NULL) { /* there is always a stranger when there is no place */
        drop(oldest);
        place = oldest;
    }
    fcntl(fd, F_SETFL, O_NONBLOCK);
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
    memset(place, 0, sizeof *place);
    place->fd = fd;
    place->opened = place->heard = place->pinged = place->moved = now;
}

bool links_listen(int *port, const handler *to, const char *epoch) {
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons((uint16_t)*port)};
    socklen_t size = sizeof address;
    int one = 1;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK); /* without a secret, nobody beyond this machine */
    robot_side = to;
    own_epoch = epoch;
    for (int i = 0; i < MAX_LINKS + MAX_STRANGERS; i++) all[i].fd = -1;
    listener = socket(AF_INET, SOCK_STREAM, 0);
    if (listener < 0) return false;
    setsockopt(listener, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one);
    fcntl(listener, F_SETFL, O_NONBLOCK);
    if (bind(listener, (struct sockaddr *)&address, sizeof address) < 0 || listen(listener, 64) < 0) return false;
    if (getsockname(listener, (struct sockaddr *)&address, &size) < 0) return false;
    *port = ntohs(address.sin_port);
    return true;
}

void links_serve(double timeout, double (*now)(void)) {
    struct pollfd polled[MAX_LINKS + MAX_STRANGERS + 1] = {{.fd = listener, .events = POLLIN}};
    for (int i = 0; i < MAX_LINKS + MAX_STRANGERS; i++)
        polled[i + 1] = (struct pollfd){.fd = all[i].fd, .events = POLLIN | (has_output(&all[i]) ? POLLOUT : 0)};
    poll(polled, MAX_LINKS + MAX_STRANGERS + 1, timeout < 0 ? 0 : (int)(timeout * 1000 + 0.999));
    double time = now(), slept = served == 0 ? 0 : time - served;
    for (int i = 0; i < MAX_LINKS + MAX_STRANGERS; i++) {
        peer *of = &all[i];
        /* Time in which this process itself was stopped is not the clients' silence. */
        if (of->fd >= 0 && slept > SILENCE / 2) {
            of->heard += slept;
            of->moved += slept;
        }
        if (of->fd >= 0 && of->fd == polled[i + 1].fd && polled[i + 1].revents & (POLLIN | POLLHUP | POLLERR))
            receive(of, time);
        if (of->fd >= 0) look_after(of, time);
        if (of->fd >= 0) transmit(of, time);
    }
    if (polled[0].revents & POLLIN) welcome(time);
    served = time;
}

void links_close(double (*now)(void)) {
    for (int i = 0; i < MAX_LINKS + MAX_STRANGERS; i++)
        if (all[i].fd >= 0) say_goodbye(&all[i], "closing", now());
    for (int i = 0; i < MAX_LINKS + MAX_STRANGERS; i++) {
        if (all[i].fd >= 0) transmit(&all[i], now());
        if (all[i].fd >= 0) drop(&all[i]);
    }
    if (listener >= 0) close(listener);
}
