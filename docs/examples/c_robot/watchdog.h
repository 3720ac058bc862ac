/* Brings the robot to rest when the control loop hangs, and ends the program when it does so for good. The kernel's
 * timer interrupts whatever call hangs; nothing helps a program that is killed or stopped. */
#ifndef WATCHDOG_H
#define WATCHDOG_H

extern const double WATCHDOG; /* s without a tick after which the robot is brought to rest, and every so often then */

/* `rest` is called from a signal handler, in the middle of anything: see signal-safety(7) for what it may do. */
void watchdog_start(void (*rest)(void));
/* A tick has ended. */
void watchdog_ticked(void);
void watchdog_end(void);

#endif
