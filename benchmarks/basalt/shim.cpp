// Preloaded: dai::DeviceBase::getCalibration() returns the calibration in the file $BASALT_CALIBRATION, without a device.
// $BASALT_CORE: file name of the core library of depthai.
#include <dlfcn.h>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <optional>

extern "C" void* _ZN3dai10DeviceBase14getCalibrationEv(void* result, void*) {
    using Constructor = void (*)(void*, std::filesystem::path*, std::optional<bool>);
    void* core = dlopen(getenv("BASALT_CORE"), RTLD_NOLOAD | RTLD_LAZY);
    void* found = core ? dlsym(core, "_ZN3dai18CalibrationHandlerC1ENSt10filesystem7__cxx114pathESt8optionalIbE") : nullptr;
    if(!found) {
        fprintf(stderr, "found no CalibrationHandler of depthai: %s\n", dlerror());
        exit(1);
    }
    std::filesystem::path path(getenv("BASALT_CALIBRATION"));
    reinterpret_cast<Constructor>(found)(result, &path, std::nullopt);
    return result;
}
