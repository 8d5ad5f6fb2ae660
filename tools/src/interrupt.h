#ifndef THICKLENS_TOOLS_INTERRUPT_H_
#define THICKLENS_TOOLS_INTERRUPT_H_

namespace thicklens::tools {

// SIGINT and SIGTERM raise a flag, which long loops look at: they end by an exception, so that
// half-written outputs are dropped on the way. SIGPIPE and SIGXFSZ are ignored: a write that fails
// is told like any other failed write.
void CatchSignals();

bool InterruptRequested();
void ThrowIfInterrupted();  // throws Interrupted

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_INTERRUPT_H_
