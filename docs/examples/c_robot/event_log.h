/* A line of JSON for each thing that happens to events, as docs/robot-link.md describes it. */
#ifndef EVENT_LOG_H
#define EVENT_LOG_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

bool log_open(const char *path);
void log_start(double time, uint32_t event, const char *epoch);
void log_executed(double time, uint32_t event, uint64_t issue, const double *values, size_t count);
void log_feedback(double time, uint32_t event, uint32_t issue, bool at_rest);
void log_refused(double time, uint32_t event, const char *reason, uint32_t current);
void log_media(double time, uint32_t event, const char *stream, double captured);
void log_rest(double time, uint32_t event, bool applied);
/* No tick came for so long. */
void log_stall(double time, uint32_t event, double seconds);
/* "stop", "reset", "driven" and "at_rest" */
void log_plain(double time, uint32_t event, const char *kind);
void log_close(void);

#endif
