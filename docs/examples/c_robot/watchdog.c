#include "watchdog.h"

#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <sys/time.h>
#include <unistd.h>

enum { HUNG = 3 }; /* exit code */

const double WATCHDOG = 0.15; /* half of HOLD */

static const int GIVE_UP = 67; /* times, 10 s: whoever started the program is to start it again */
static void (*bring_to_rest)(void);
static volatile sig_atomic_t acted;

/* Only where it does not block: this must end. */
static void say_why(void) {
    static const char WHY[] = "c_robot hung: no control tick for 10 s\n";
    struct pollfd errors = {.fd = STDERR_FILENO, .events = POLLOUT};
    if (poll(&errors, 1, 0) == 1 && write(STDERR_FILENO, WHY, sizeof WHY - 1) < 0) return;
}

static void on_alarm(int signal) {
    int before = errno;
    (void)signal;
    bring_to_rest();
    if (++acted >= GIVE_UP) {
        say_why();
        _exit(HUNG);
    }
    errno = before;
}

static void wind_up(double seconds) {
    struct timeval span = {.tv_sec = (time_t)seconds, .tv_usec = (suseconds_t)(seconds * 1e6) % 1000000};
    struct itimerval timer = {.it_interval = span, .it_value = span};
    setitimer(ITIMER_REAL, &timer, NULL);
}

void watchdog_start(void (*rest)(void)) {
    struct sigaction action = {.sa_handler = on_alarm, .sa_flags = SA_RESTART};
    sigset_t alarm_alone;
    bring_to_rest = rest;
    sigemptyset(&action.sa_mask);
    sigaction(SIGALRM, &action, NULL);
    sigemptyset(&alarm_alone);
    sigaddset(&alarm_alone, SIGALRM);
    sigprocmask(SIG_UNBLOCK, &alarm_alone, NULL);
    wind_up(WATCHDOG);
}

void watchdog_ticked(void) {
    wind_up(WATCHDOG);
    acted = 0;
}

void watchdog_end(void) { wind_up(0); }
