/* Faults of a request, gathered as text: one line each, as many as fit. */
#ifndef BALLPASS_FAULTS_H
#define BALLPASS_FAULTS_H

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

typedef struct {
    int count;
    char text[4096];
} ballpass_faults;

#if defined(__GNUC__)
__attribute__((format(printf, 2, 3), unused))
#endif
static void add_fault(ballpass_faults *faults, const char *format, ...)
{
    const size_t used = strlen(faults->text);
    va_list given;
    faults->count++;
    if (used + 2 >= sizeof faults->text) return;
    if (used) strcat(faults->text, "\n");
    va_start(given, format);
    vsnprintf(faults->text + strlen(faults->text), sizeof faults->text - strlen(faults->text), format, given);
    va_end(given);
}

#endif
