/* SPDX-License-Identifier: MIT
 * dbc_cia402.c - the PDOs of [cia402] as a DBC file; see dbc.h.
 */
#include "platform/cia402_section.h"
#include "inspect/dbc.h"

#define COB_EMCY 0x080u

/* A field of a PDO, by the object that is mapped. */
typedef struct {
    uint32_t entry; /* as in 1A00h, of 8, 16 or 32 bits */
    const char *name;
    char sign;
    enum { PLAIN, POSITION, DISTANCE, PERMILLE } reading;
} field_t;

static const field_t k_fields[] = {
    {0x60400010, "controlword", '+', PLAIN}, {0x607A0020, "target", '-', POSITION},
    {0x60C10120, "target", '-', POSITION},   {0x60410010, "statusword", '+', PLAIN},
    {0x60640020, "actual", '-', POSITION},   {0x60610008, "mode", '-', PLAIN},
    {0x60770010, "torque", '-', PERMILLE},   {0x60F40020, "following_error", '-', DISTANCE},
    {0x60FD0020, "inputs", '+', PLAIN},
};

static unsigned cylinders_of(const config_t *config)
{
    return config->settings.geometry.kind == KIN_HEXAPOD ? 6u : 3u;
}

/* An object that a fixed map has beside is a number without a name. */
static field_t field_of(uint32_t entry, char name[24])
{
    const uint32_t plain = (uint32_t)cia402_plain_index((uint16_t)(entry >> 16)) << 16 | (entry & 0xFFFFu);
    for (unsigned i = 0; i < sizeof k_fields / sizeof k_fields[0]; i++) {
        if (k_fields[i].entry == plain) {
            return k_fields[i];
        }
    }
    (void)snprintf(name, 24, "x%04X_%02X", (unsigned)(entry >> 16), (unsigned)(entry >> 8 & 0xFFu));
    return (field_t){entry, name, '+', PLAIN};
}

/* value = raw * factor + offset */
static void write_signal(const config_t *config, unsigned drive, bool is_of_node, uint32_t entry, unsigned *bit,
                         const char *receiver, FILE *out)
{
    char name[24];
    char of_drive[16] = "";
    const field_t field = field_of(entry, name);
    if (is_of_node) {
        (void)snprintf(of_drive, sizeof of_drive, "_drive%u", drive + 1u);
    }
    const counts_scale_t scale = config_cia402_scale(config, drive);
    const unsigned bits = entry & 0xFFu;
    const double per_count = (double)scale.den / scale.num;
    const bool is_scaled = field.reading == POSITION || field.reading == DISTANCE;
    const double factor = is_scaled ? per_count : field.reading == PERMILLE ? 0.1 : 1.0;
    const double offset = field.reading == POSITION && scale.zero != 0 ? -scale.zero * per_count : 0.0;
    const char *length = drive >= cylinders_of(config) ? "deg" : "mm";
    char number[2][32];
    fprintf(out, " SG_ %s%s : %u|%u@1%c (%s,%s) [0|0] \"%s\" %s\n", field.name, of_drive, *bit, bits, field.sign,
            dbc_decimal(factor, number[0]), dbc_decimal(offset, number[1]),
            is_scaled                   ? length
            : field.reading == PERMILLE ? "%"
                                        : "",
            receiver);
    *bit += bits;
}

/* What is in a PDO of its node is of several drives: their names stand behind. */
static bool is_of_node(const cia402_config_t *drives, unsigned drive, const cia402_pdo_t *pdo)
{
    for (unsigned i = 0; i < pdo->entries; i++) {
        if (cia402_axis_of(drives, drives->axis[drive].node, pdo->entry[i]) != drive && pdo->entry[i] >> 16 >= 0x6000u) {
            return true;
        }
    }
    return false;
}

static void write_pdo(const config_t *config, const cia402_config_t *drives, unsigned drive, unsigned which, FILE *out)
{
    static const char *const k_names[CIA402_PDOS] = {"command", "command2", "command3",  "answer",
                                                     "answer2", "answer3",  "telemetry", "telemetry2"};
    const cia402_pdo_t pdo = cia402_pdo(drives, drive, which);
    const bool is_answer = which >= CIA402_ANSWER;
    const bool is_shared = is_of_node(drives, drive, &pdo);
    char node[16];
    unsigned bit = 0;
    if (pdo.entries == 0) {
        return;
    }
    (void)snprintf(node, sizeof node, "drive%u", drive + 1u);
    fprintf(out, "\nBO_ %u drive%u_%s: %u %s\n", pdo.id, drive + 1u, k_names[which], pdo.bytes, is_answer ? node : "heaved");
    for (unsigned i = 0; i < pdo.entries; i++) {
        const unsigned of = cia402_axis_of(drives, drives->axis[drive].node, pdo.entry[i]);
        write_signal(config, of < drives->axes ? of : drive, is_shared, pdo.entry[i], &bit, is_answer ? "heaved" : node, out);
    }
}

static void write_emergency(unsigned drive, uint32_t id, FILE *out)
{
    fprintf(out, "\nBO_ %lu drive%u_emergency: 8 drive%u\n", (unsigned long)id, drive + 1u, drive + 1u);
    fprintf(out, " SG_ code : 0|16@1+ (1,0) [0|65535] \"\" heaved\n SG_ register : 16|8@1+ (1,0) [0|255] \"\" heaved\n"
                 " SG_ manufacturer : 24|40@1+ (1,0) [0|0] \"\" heaved\n");
}

static void write_drive(const config_t *config, const cia402_config_t *drives, unsigned drive, FILE *out)
{
    for (unsigned which = 0; which < CIA402_PDOS; which++) {
        write_pdo(config, drives, drive, which, out);
    }
    if (drives->axis[drive].channel == 0) {
        write_emergency(drive, COB_EMCY + drives->axis[drive].node, out);
    }
}

void dbc_write_cia402(const config_t *config, FILE *out)
{
    cia402_config_t drives;
    config_cia402(config, &drives);
    fprintf(out, "VERSION \"\"\n\nNS_ :\n\nBS_:\n\nBU_: heaved");
    for (unsigned drive = 0; drive < drives.axes; drive++) {
        fprintf(out, " drive%u", drive + 1u);
    }
    fprintf(out, "\n");
    for (unsigned drive = 0; drive < drives.axes; drive++) {
        write_drive(config, &drives, drive, out);
    }
    fprintf(out, "\nCM_ \"Written by heaved --dump-dbc. Positions are extensions, 0 is fully in.\";\n");
}
