#ifndef THICKLENS_TOOLS_COMMANDS_CAMERA_VERIFY_H_
#define THICKLENS_TOOLS_COMMANDS_CAMERA_VERIFY_H_

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <string>

#include "thicklens/calib/verification.h"
#include "tools/options/command_frame.h"

namespace thicklens::tools {

// The printed output of `thicklens camera verify`, and its --json without the names of the files.
std::string VerificationText(const calib::Verification& verification);
nlohmann::json VerificationJson(const calib::Verification& verification);

// Adds `thicklens camera verify CAMERA SWEEP`.
void AddCameraVerifyCommand(CLI::App* camera, CommandAction* action);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_COMMANDS_CAMERA_VERIFY_H_
