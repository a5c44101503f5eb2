/* Tandem policy scripts in C: ABI version 1.
 *
 * A script includes this header once, declares its parameters, and writes a function of one block, one of a rough
 * period, or both. docs/policies.md explains every number.
 *
 *   #include "tandem_policy.h"
 *   static tandem_parameter parameters[] = {
 *     TANDEM_PARAMETER("most_mm_per_min", 1000, 1, 100000, "Highest feed, mm/min"),
 *   };
 *   TANDEM_POLICY(parameters)
 *   TANDEM_ON_BLOCK(block) { block->ask_feed_cap_mm_per_s = parameters[0].value / 60; }
 */
#ifndef TANDEM_POLICY_H
#define TANDEM_POLICY_H

#include <stdint.h>

/* Kinds of a block. */
enum { TANDEM_RAPID, TANDEM_LINE, TANDEM_ARC, TANDEM_NURBS, TANDEM_DWELL };
/* Flags of a block: the machine is at rest at its start, at its end. */
enum { TANDEM_STARTS_AT_REST = 1, TANDEM_ENDS_AT_REST = 2 };

/* One block. What begins with ask_ is the answer; what is not written stays as it is. */
typedef struct tandem_block {
  uint32_t size;
  uint32_t line;  /* of the part program */
  uint32_t kind;  /* TANDEM_RAPID to TANDEM_DWELL */
  uint32_t tool;  /* in the spindle */
  uint32_t flags; /* TANDEM_STARTS_AT_REST, TANDEM_ENDS_AT_REST */
  uint32_t reserved;
  double length_mm;         /* of the path */
  double feed_mm_per_s;     /* that may be driven; infinite for a rapid */
  double turn_in_rad;       /* from the block before: 0 is straight on, pi a reversal */
  double turn_out_rad;      /* into the next block */
  double curvature_per_mm;  /* the largest; 0 for a line */
  double spindle_rad_per_s; /* commanded */
  double time_constant_s;   /* in force */
  double path_tolerance_mm; /* in force */
  double feed_cap_mm_per_s; /* in force; infinite where there is none */
  double ask_time_constant_s;
  double ask_path_tolerance_mm;
  double ask_feed_cap_mm_per_s;
} tandem_block;

/* Means over one rough period. What the machine does not know is NaN. */
typedef struct tandem_period {
  uint32_t size;
  uint32_t line; /* that moved last */
  uint64_t period;
  double duration_s;
  double feed_mm_per_s;            /* commanded */
  double programmed_feed_mm_per_s; /* infinite in a rapid */
  double following_error_mm;
  double max_following_error_mm;
  double cutting_torque_nm;
  double reference_torque_nm;
  double spindle_load; /* 1 at full load */
  double spindle_rad_per_s;
  double distance_left_mm;
  double ratio;          /* that this script asked for last */
  double strategy_ratio; /* 1 without a feed strategy */
  double current_a[8];
} tandem_period;

/* One parameter of the machine file. */
typedef struct tandem_parameter {
  uint32_t size;
  const char *name;
  uint32_t name_bytes;
  const char *text;
  uint32_t text_bytes;
  uint32_t reserved;
  double lowest;
  double highest;
  double fallback;
  double value; /* in force from the first call on */
} tandem_parameter;

typedef struct tandem_layout {
  uint32_t size;
  uint32_t block_bytes;
  tandem_block *window;
  uint32_t window_blocks;
  uint32_t period_bytes;
  tandem_period *period;
  uint32_t parameter_bytes;
  tandem_parameter *parameters;
  uint32_t parameter_count;
  uint32_t text; /* 0: UTF-8 */
  void *state;
  uint32_t state_bytes;
} tandem_layout;

_Static_assert(sizeof(tandem_block) == 120, "compile with --target=wasm32");
_Static_assert(sizeof(tandem_period) == 176, "compile with --target=wasm32");
_Static_assert(sizeof(tandem_parameter) == 56, "compile with --target=wasm32");
_Static_assert(sizeof(tandem_layout) == 48, "compile with --target=wasm32");

#define TANDEM_EXPORT(name) __attribute__((export_name(name)))

#define TANDEM_PARAMETER(name, fallback, lowest, highest, text) \
  {sizeof(tandem_parameter), name, sizeof(name) - 1, text, sizeof(text) - 1, 0, lowest, highest, fallback, fallback}

#define TANDEM_LAYOUT(parameters, count, state, bytes)                                                               \
  static tandem_block tandem_window[64];                                                                             \
  static tandem_period tandem_means;                                                                                 \
  static tandem_layout tandem_said;                                                                                  \
  TANDEM_EXPORT("tandem_policy_v1") tandem_layout *tandem_policy_v1(void) {                                          \
    tandem_said = (tandem_layout){sizeof(tandem_layout), sizeof(tandem_block), tandem_window,    64,                 \
                                  sizeof(tandem_period), &tandem_means,        sizeof(tandem_parameter), parameters, \
                                  count,                 0,                    state,                    bytes};     \
    return &tandem_said;                                                                                             \
  }

/* Exports what the host asks for first. */
#define TANDEM_POLICY(parameters) TANDEM_LAYOUT(parameters, sizeof(parameters) / sizeof((parameters)[0]), 0, 0)
/* The same for a script without parameters. */
#define TANDEM_POLICY_WITHOUT_PARAMETERS TANDEM_LAYOUT(0, 0, 0, 0)
/* The same for a script with state, a variable, that survives a reload. */
#define TANDEM_POLICY_WITH_STATE(parameters, variable)                                                          \
  static __typeof__(variable) tandem_state;                                                                     \
  TANDEM_EXPORT("save") uint32_t tandem_save(void) { return tandem_state = variable, sizeof(tandem_state); }    \
  TANDEM_EXPORT("restore") void tandem_restore(uint32_t bytes) {                                                \
    if (bytes == sizeof(tandem_state)) variable = tandem_state;                                                 \
  }                                                                                                             \
  TANDEM_LAYOUT(parameters, sizeof(parameters) / sizeof((parameters)[0]), &tandem_state, sizeof(tandem_state))

/* Begins the function of one block. */
#define TANDEM_ON_BLOCK(block)                                                                       \
  static inline void tandem_tune(tandem_block *block);                                               \
  TANDEM_EXPORT("on_blocks") void tandem_on_blocks(tandem_block *window, int32_t count) {            \
    for (int32_t i = 0; i < count; i++) tandem_tune(&window[i]);                                     \
  }                                                                                                  \
  static inline void tandem_tune(tandem_block *block)

/* Begins the function of one rough period; it returns the feed ratio, TANDEM_NO_RATIO for none. */
#define TANDEM_ON_PERIOD(period)                                                                            \
  static inline double tandem_ratio(const tandem_period *period);                                           \
  TANDEM_EXPORT("on_period") double tandem_on_period(tandem_period *period) { return tandem_ratio(period); } \
  static inline double tandem_ratio(const tandem_period *period)

#define TANDEM_NO_RATIO __builtin_nan("")

#endif
