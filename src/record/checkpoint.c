/* SPDX-License-Identifier: MIT
 * checkpoint.c - where an offline run goes on from; see checkpoint.h.
 */
#include "record/checkpoint.h"

#include <string.h>

#include "common/decimal.h"

#define CRC_POLYNOMIAL 0xEDB88320u
#define CRC_DIGITS     8u

#if __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
#define BYTE_ORDER_NAME "le"
#else
#define BYTE_ORDER_NAME "be"
#endif

/* What the bytes mean depends on the version and on the order of bytes; their number tells most other machines. */
static const char k_version[] = HEAVE_VERSION "-" BYTE_ORDER_NAME " ";

static uint32_t crc_of(const uint8_t *bytes, size_t length)
{
    uint32_t crc = UINT32_MAX;
    for (size_t i = 0; i < length; i++) {
        crc ^= bytes[i];
        for (unsigned bit = 0; bit < 8; bit++) {
            crc = (crc >> 1) ^ ((crc & 1u) != 0 ? CRC_POLYNOMIAL : 0u);
        }
    }
    return ~crc;
}

void checkpoint_copy(const session_t *session, session_t *out)
{
    *out = *session;
    gateway_save(&session->gateway, &out->gateway);
}

size_t checkpoint_format(const session_t *saved, const char *hash, char to[CHECKPOINT_LINE_MAX])
{
    const uint8_t *bytes = (const uint8_t *)saved;
    size_t at = decimal_put_ms(to, saved->now_us - saved->zero_us);
    at += decimal_put_text(&to[at], " !state ");
    at += decimal_put_text(&to[at], k_version);
    at += decimal_put_text(&to[at], hash);
    at += decimal_put_text(&to[at], " ");
    at += decimal_put_hex(&to[at], crc_of(bytes, sizeof *saved), CRC_DIGITS);
    at += decimal_put_text(&to[at], " ");
    for (size_t i = 0; i < sizeof *saved; i++) {
        at += decimal_put_hex(&to[at], bytes[i], 2);
    }
    return at + decimal_put_text(&to[at], "\n");
}

static int digit_of(uint8_t byte)
{
    const int letter = byte - 'A';
    return byte >= '0' && byte <= '9' ? byte - '0' : letter >= 0 && letter < 6 ? letter + 10 : -1;
}

/* So many digits; false where one is none. */
static bool read_hex(const uint8_t *text, size_t digits, uint32_t *out)
{
    *out = 0;
    for (size_t i = 0; i < digits; i++) {
        const int digit = digit_of(text[i]);
        if (digit < 0) {
            return false;
        }
        *out = *out << 4 | (uint32_t)digit;
    }
    return true;
}

static bool read_bytes(const uint8_t *text, uint8_t *bytes, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        uint32_t byte = 0;
        if (!read_hex(&text[2 * i], 2, &byte)) {
            return false;
        }
        bytes[i] = (uint8_t)byte;
    }
    return true;
}

const char *checkpoint_parse(const uint8_t *text, size_t length, const char *hash, session_t *out)
{
    const size_t version = strlen(k_version);
    const size_t about = version + strlen(hash) + 1;
    const size_t head = about + CRC_DIGITS + 1;
    uint32_t crc = 0;
    if (length != head + 2 * sizeof *out || memcmp(text, k_version, version) != 0) {
        return "the !state is of another version of heaved, or of another kind of machine; play it with the heaved that wrote it";
    }
    if (memcmp(&text[version], hash, strlen(hash)) != 0) {
        return "the !state is of another configuration; play it with the platform.ini beside it";
    }
    if (!read_hex(&text[about], CRC_DIGITS, &crc) || !read_bytes(&text[head], (uint8_t *)out, sizeof *out) ||
        crc != crc_of((const uint8_t *)out, sizeof *out)) {
        return "the !state is damaged; it has to be as heaved wrote it";
    }
    return NULL;
}
