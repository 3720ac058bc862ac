#include "event_log.h"

#include <stdio.h>

static FILE *file; /* NULL: nothing is logged */

static bool begin(double time, uint32_t event, const char *kind) {
    if (file != NULL) fprintf(file, "{\"kind\":\"%s\",\"time\":%.6f,\"event\":%u", kind, time, event);
    return file != NULL;
}

static void end(void) {
    fputs("}\n", file);
    fflush(file);
}

bool log_open(const char *path) {
    file = fopen(path, "a");
    return file != NULL;
}

void log_start(double time, uint32_t event, const char *epoch) {
    if (!begin(time, event, "start")) return;
    fprintf(file, ",\"epoch\":\"%s\"", epoch);
    end();
}

void log_executed(double time, uint32_t event, uint64_t issue, const double *values, size_t count) {
    if (!begin(time, event, "executed")) return;
    fprintf(file, ",\"issue\":%llu,\"values\":[", (unsigned long long)issue);
    for (size_t i = 0; i < count; i++) fprintf(file, "%s%.9g", i > 0 ? "," : "", values[i]);
    fputs("]", file);
    end();
}

void log_feedback(double time, uint32_t event, uint32_t issue, bool at_rest) {
    if (!begin(time, event, "feedback")) return;
    fprintf(file, ",\"issue\":%u,\"at_rest\":%s", issue, at_rest ? "true" : "false");
    end();
}

void log_refused(double time, uint32_t event, const char *reason, uint32_t current) {
    if (!begin(time, event, "refused")) return;
    fprintf(file, ",\"reason\":\"%s\",\"current\":%u", reason, current);
    end();
}

void log_media(double time, uint32_t event, const char *stream, double captured) {
    if (!begin(time, event, "media")) return;
    fprintf(file, ",\"stream\":\"%s\",\"captured\":%.6f", stream, captured);
    end();
}

void log_rest(double time, uint32_t event, bool applied) {
    if (!begin(time, event, "rest")) return;
    fprintf(file, ",\"applied\":%s", applied ? "true" : "false");
    end();
}

void log_plain(double time, uint32_t event, const char *kind) {
    if (begin(time, event, kind)) end();
}

void log_stall(double time, uint32_t event, double seconds) {
    if (!begin(time, event, "stall")) return;
    fprintf(file, ",\"seconds\":%.3f,\"watchdog\":true", seconds);
    end();
}

void log_close(void) {
    if (file != NULL) fclose(file);
    file = NULL;
}
