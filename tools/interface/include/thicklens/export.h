#ifndef THICKLENS_EXPORT_H_
#define THICKLENS_EXPORT_H_

// Marks the symbols of the public interface: they stay visible in a program or library that is
// compiled with -fvisibility=hidden. thicklens itself is built as static libraries.
#if defined(__GNUC__) || defined(__clang__)
#define THICKLENS_EXPORT __attribute__((visibility("default")))
#else
#define THICKLENS_EXPORT
#endif

#endif  // THICKLENS_EXPORT_H_
