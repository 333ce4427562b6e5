/*
 * replay_frames: a morph as a row of meshes or pictures.
 */
#ifndef WH_TOOLS_REPLAY_FRAMES_H
#define WH_TOOLS_REPLAY_FRAMES_H

#include "replay_options.h"

/* Writes the frames of the morph that was made of `r`. WH_E_USAGE, before the first one, when one
 * of them exists and may not be written over. After any other failure those before it are there. */
wh_code replay_frames(wh_ctx *c, wh_replay *r, const replay_options *o);

#endif
