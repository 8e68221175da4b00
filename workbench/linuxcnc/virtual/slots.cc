// SPDX-License-Identifier: GPL-2.0-or-later
// The slots through which a loaded file calls the functions of other files.

#include "virtual.h"

#include <dlfcn.h>
#include <elf.h>
#include <link.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cstring>
#include <functional>

namespace {
// Returns whether a file is meant, and what to do with each slot and the name of its function.
struct Walk {
    std::function<bool(const char *)> is_meant;
    std::function<void(const char *, void **)> each;
};

int visit(dl_phdr_info *info, size_t, void *asked) {
    const Walk &walk = *static_cast<const Walk *>(asked);
    if (!walk.is_meant(info->dlpi_name)) {
        return 0;
    }
    const ElfW(Sym) *symbols = nullptr;
    const char *names = nullptr;
    const ElfW(Rela) *tables[2] = {};
    size_t sizes[2] = {};
    for (int n = 0; n < info->dlpi_phnum; n++) {
        if (info->dlpi_phdr[n].p_type != PT_DYNAMIC) {
            continue;
        }
        auto entry = reinterpret_cast<const ElfW(Dyn) *>(info->dlpi_addr + info->dlpi_phdr[n].p_vaddr);
        for (; entry->d_tag != DT_NULL; entry++) {
            switch (entry->d_tag) {
            case DT_SYMTAB: symbols = reinterpret_cast<const ElfW(Sym) *>(entry->d_un.d_ptr); break;
            case DT_STRTAB: names = reinterpret_cast<const char *>(entry->d_un.d_ptr); break;
            case DT_JMPREL: tables[0] = reinterpret_cast<const ElfW(Rela) *>(entry->d_un.d_ptr); break;
            case DT_PLTRELSZ: sizes[0] = entry->d_un.d_val; break;
            case DT_RELA: tables[1] = reinterpret_cast<const ElfW(Rela) *>(entry->d_un.d_ptr); break;
            case DT_RELASZ: sizes[1] = entry->d_un.d_val; break;
            default: break;
            }
        }
    }
    for (int t = 0; symbols && names && t < 2; t++) {
        for (size_t n = 0; tables[t] && n < sizes[t] / sizeof(ElfW(Rela)); n++) {
            const ElfW(Rela) &slot = tables[t][n];
            const char *name = names + symbols[ELF64_R_SYM(slot.r_info)].st_name;
            walk.each(name, reinterpret_cast<void **>(info->dlpi_addr + slot.r_offset));
        }
    }
    return 0;
}

bool begins(const char *text, const char *with) { return std::strncmp(text, with, std::strlen(with)) == 0; }
}

namespace slots {
// Symbols are searched in the executable first, so that a function of the same name in a preloaded library is never
// found.
bool replace(const char *library, const char *symbol, void *replacement) {
    bool found = false;
    Walk walk = {[&](const char *file) { return std::strstr(file, library) != nullptr; },
                 [&](const char *name, void **slot) {
                     if (std::strcmp(name, symbol) != 0) {
                         return;
                     }
                     const size_t page = static_cast<size_t>(sysconf(_SC_PAGESIZE));
                     // The table is read-only once the library is loaded.
                     mprotect(reinterpret_cast<void *>(reinterpret_cast<size_t>(slot) & ~(page - 1)), page,
                              PROT_READ | PROT_WRITE);
                     *slot = replacement;
                     found = true;
                 }};
    dl_iterate_phdr(visit, &walk);
    return found;
}

void check() {
    std::string uncovered;
    Walk walk = {[](const char *file) { return !std::strstr(file, "liblinuxcnchal"); },
                 [&](const char *name, void **) {
                     if (!begins(name, "hal_") && !begins(name, "halpr_") && !begins(name, "rtapi_")) {
                         return;
                     }
                     Dl_info found = {};
                     void *const function = dlsym(RTLD_DEFAULT, name);
                     if (function && dladdr(function, &found) && std::strstr(found.dli_fname, "liblinuxcnchal")) {
                         uncovered = name;
                     }
                 }};
    dl_iterate_phdr(visit, &walk);
    if (!uncovered.empty()) {
        give_up("this LinuxCNC uses %s, which has no substitute in virtual time", uncovered.c_str());
    }
}
}
