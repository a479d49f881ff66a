/* SPDX-License-Identifier: MIT
 * cia402_visit.c - see cia402_visit.h.
 */
#include "cia402_visit.h"

/* The driver talks by SDO while it looks for a drive and sets it up, changes its mode, or asks for its error. */
static bool is_free(const cia402_t *self, unsigned k)
{
    const cia402_axis_t *axis = &self->axis[k];
    return !self->is_gone && axis->setup.job == CIA402_JOB_NONE && axis->nmt_command == 0 && axis->sdo.state != SDO_BUSY &&
           (axis->phase == CIA402_UP || axis->phase == CIA402_REFUSED);
}

sdo_t *cia402_sdo_of(cia402_t *self, unsigned k)
{
    const bool is_visited = self->visit == DRIVE_OBJECT_BUSY && self->visited == k && is_free(self, k);
    return is_visited ? &self->visitor : &self->axis[k].sdo;
}

void cia402_visit_step(cia402_t *self)
{
    if (self->visit != DRIVE_OBJECT_BUSY) {
        return;
    }
    if (!is_free(self, self->visited)) {
        sdo_cancel(&self->visitor);
        self->visit = DRIVE_OBJECT_LEFT;
        return;
    }
    switch (self->visitor.state) {
    case SDO_DONE:
        self->visit = DRIVE_OBJECT_DONE;
        break;
    case SDO_ABORTED:
        self->visit = self->visitor.has_request ? DRIVE_OBJECT_BUSY : DRIVE_OBJECT_REFUSED; /* the drive is told first */
        break;
    case SDO_SILENT:
        self->visit = DRIVE_OBJECT_SILENT;
        break;
    case SDO_IDLE:
    case SDO_BUSY:
        break;
    }
}

hv_status_t cia402_visit_begin(void *ctx, uint8_t axis, const drive_object_t *object)
{
    cia402_t *self = ctx;
    if (self->visit == DRIVE_OBJECT_BUSY) {
        return HV_ERR_AGAIN;
    }
    if (object->is_write && (object->size < 1 || object->size > SDO_BYTES_MAX)) {
        return HV_ERR_RANGE;
    }
    if (object->is_write && cia402_is_relied_on(self->config, axis, object->index, object->sub)) {
        return HV_ERR_ARG;
    }
    if (!self->has_time || !is_free(self, axis)) {
        return HV_ERR_STATE;
    }
    sdo_init(&self->visitor, self->config->axis[axis].node, self->config->sdo_timeout_ms * 1000u);
    if (object->is_write) {
        sdo_write(&self->visitor, object->index, object->sub, object->value, object->size, 1);
    } else {
        sdo_read(&self->visitor, object->index, object->sub, 1);
    }
    self->visited = axis;
    self->visit = DRIVE_OBJECT_BUSY;
    return HV_OK;
}

drive_object_state_t cia402_visit_end(void *ctx, drive_object_t *out, uint32_t *code)
{
    const cia402_t *self = ctx;
    if (self->visit == DRIVE_OBJECT_DONE && self->visitor.is_read) {
        out->size = self->visitor.size;
        for (unsigned i = 0; i < self->visitor.size; i++) {
            out->value[i] = self->visitor.value[i];
        }
    } else if (self->visit == DRIVE_OBJECT_REFUSED) {
        *code = self->visitor.abort_code;
    }
    return self->visit;
}

/* --- What nobody writes beside the driver --- */

/* Ranges of objects, both ends included: whatever the configuration is. What it has the driver write comes beside. */
static const uint16_t k_kept[][2] = {
    {0x1005, 0x1007}, /* SYNC */
    {0x100B, 0x100B}, /* node id, of older versions */
    {0x1012, 0x1017}, /* time stamp, emergencies, heartbeat */
    {0x1019, 0x1019}, /* SYNC counter */
    {0x1028, 0x1029}, /* emergencies, what an error does */
    {0x1200, 0x12FF}, /* SDO itself */
    {0x1400, 0x1BFF}, /* PDOs */
    {0x1F50, 0x1F57}, /* its program */
    {0x1F80, 0x1F8A}, /* start without a master */
    {0x6007, 0x6007}, /* what a lost master does */
    {0x6040, 0x6040}, /* controlword */
    {0x6042, 0x6042}, /* target velocity of mode vl */
    {0x605A, 0x605E}, /* what stops do */
    {0x6060, 0x6060}, /* mode */
    {0x6065, 0x6066}, /* following window */
    {0x6071, 0x6071}, /* target torque */
    {0x607A, 0x607A}, /* target position */
    {0x607C, 0x607E}, /* zero, limits, polarity */
    {0x6089, 0x608A}, /* units of position */
    {0x608F, 0x6097}, /* how long a count is */
    {0x60A8, 0x60A9}, /* likewise */
    {0x60B0, 0x60B2}, /* offsets of targets */
    {0x60C0, 0x60C2}, /* interpolation */
    {0x60FE, 0x60FF}, /* outputs: its brake; target velocity */
};

static bool is_wished(const cia402_config_t *config, unsigned axis, uint16_t index, uint8_t sub)
{
    cia402_wish_t wish = {.row = 0};
    while (cia402_next_wish(config, axis, &wish)) {
        if (wish.index == index && wish.sub == sub && wish.is_written) {
            return true;
        }
    }
    return false;
}

bool cia402_is_relied_on(const cia402_config_t *config, unsigned axis, uint16_t index, uint8_t sub)
{
    const uint16_t plain = cia402_plain_index(index);
    for (size_t i = 0; i < sizeof k_kept / sizeof k_kept[0]; i++) {
        if (plain >= k_kept[i][0] && plain <= k_kept[i][1]) {
            return true;
        }
    }
    for (unsigned k = 0; k < config->axes; k++) { /* the node has the objects of all its axes */
        if (config->axis[k].node == config->axis[axis].node && is_wished(config, k, index, sub)) {
            return true;
        }
    }
    return false;
}
