#include "tools/options/interface_options.h"

#include <spdlog/spdlog.h>

#include <utility>

#include "thicklens/base/printable_text.h"

namespace thicklens::tools {

OptionNames& OptionNames::Add(const OptionNames& others) {
  names_.insert(others.names_.begin(), others.names_.end());
  return *this;
}

std::string OptionNames::operator()(const std::string& field) const {
  for (std::string path = field;; path.erase(path.rfind('.'))) {
    const auto found = names_.find(path);
    if (found != names_.end()) return found->second;
    if (path.find('.') == std::string::npos) return field;
  }
}

UsageError UsageErrorOf(const OptionError& error, const OptionNames& names) {
  const std::string message = error.what();
  if (message.rfind(error.field(), 0) != 0) return UsageError(message);
  return UsageError(names(error.field()) + message.substr(error.field().size()));
}

CommandRun::CommandRun(const CommonOptions& options, OptionNames names)
    : names_(std::move(names)), quiet_(options.quiet) {
  control_.threads = options.threads;
  control_.progress = [this](const thicklens::Progress& progress) { Show(progress); };
  control_.notice = [this](const Notice& notice) { Report(notice); };
  control_.option_name = [this](const std::string& field) { return names_(field); };
}

void CommandRun::Show(const thicklens::Progress& progress) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (line_ == nullptr || stage_ != progress.stage) {
    line_.reset();  // erases its line before the next one is shown
    stage_ = progress.stage;
    line_ = std::make_unique<ProgressLine>(stage_, quiet_);
  }
  line_->Show(progress.done, progress.total);
}

void CommandRun::Report(const Notice& notice) {
  const std::lock_guard<std::mutex> lock(mutex_);
  line_.reset();
  ReportNotice(notice);
}

void ReportNotice(const Notice& notice) {
  const std::string text = PrintableUtf8(notice.text);
  switch (notice.level) {
    case Notice::Level::kDetail:
      spdlog::debug("{}", text);
      break;
    case Notice::Level::kInformation:
      spdlog::info("{}", text);
      break;
    case Notice::Level::kWarning:
      spdlog::warn("{}", text);
      break;
  }
}

}  // namespace thicklens::tools
