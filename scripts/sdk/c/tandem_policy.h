/* Tandem policy scripts in C: ABI version 2.
 *
 * A script includes this header once, declares its parameters, and writes a function of one block, one of a rough
 * period, or both. docs/policies.md explains every number.
 *
 *   #include "tandem_policy.h"
 *   static tandem_parameter parameters[] = {
 *     TANDEM_PARAMETER("max_mm_per_min", 1000, 1, 100000, "Highest feed, mm/min"),
 *   };
 *   TANDEM_POLICY(parameters)
 *   TANDEM_ON_BLOCK(block) { block->ask_feed_cap_mm_per_s = parameters[0].value / 60; }
 */
#ifndef TANDEM_POLICY_H
#define TANDEM_POLICY_H

#include <stdint.h>

/* A script that does not look at where blocks lie and which way they go defines TANDEM_WITHOUT_GEOMETRY before it includes
 * this: its calls cost less. */

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
  double tool_diameter_mm; /* NaN where the tool table has none */
  double program[8];       /* what the program has stated: see tandem_program */
#ifndef TANDEM_WITHOUT_GEOMETRY
  /* One entry an axis, in mm or rad: see tandem_axis. */
  double start[8];           /* machine coordinates */
  double end[8];             /* machine coordinates */
  double offset[8];          /* program coordinate = machine coordinate - offset */
  double start_direction[8]; /* how far the axis moves for each mm of the path */
  double end_direction[8];
  double lowest_share[8]; /* the lowest that it is anywhere in the block, with its sign */
  double highest_share[8];
#endif
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
  double position[8];       /* commanded at the end of the period, one entry an axis */
  double speed[8];          /* measured, mean */
  double axis_error[8];     /* commanded less measured, mean */
  double max_axis_error[8]; /* its largest magnitude */
  double signals[16];       /* means: see tandem_signal */
  double sigma;             /* rate of program time, 0 to 1 */
} tandem_period;

/* What the script looks at by name. */
typedef struct tandem_input {
  uint32_t size;
  uint32_t kind;
  const char *name;
  uint32_t name_bytes;
  const char *words;
  uint32_t words_bytes;
  uint32_t optional;
  uint32_t place; /* from the first call on; beyond 64 where this machine has none */
} tandem_input;

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
  tandem_input *inputs;
  uint32_t input_bytes;
  uint32_t input_count;
  uint32_t reserved;
} tandem_layout;

#ifdef TANDEM_WITHOUT_GEOMETRY
_Static_assert(sizeof(tandem_block) == 192, "compile with --target=wasm32");
#else
_Static_assert(sizeof(tandem_block) == 640, "compile with --target=wasm32");
#endif
_Static_assert(sizeof(tandem_period) == 568, "compile with --target=wasm32");
_Static_assert(sizeof(tandem_parameter) == 56, "compile with --target=wasm32");
_Static_assert(sizeof(tandem_input) == 32, "compile with --target=wasm32");
_Static_assert(sizeof(tandem_layout) == 64, "compile with --target=wasm32");

#define TANDEM_EXPORT(name) __attribute__((export_name(name)))

#define TANDEM_PARAMETER(name, fallback, lowest, highest, text) \
  {sizeof(tandem_parameter), name, sizeof(name) - 1, text, sizeof(text) - 1, 0, lowest, highest, fallback, fallback}

/* One input of TANDEM_INPUTS. What the part program states: a named parameter #<name>, or name = value in a comment; words,
 * separated by commas, stand for 0, 1, 2 and so on. */
#define TANDEM_PROGRAM(name, words) \
  {sizeof(tandem_input), 0, name, sizeof(name) - 1, words, sizeof(words) - 1, 0, UINT32_MAX}
/* A signal of the feed strategy, an analog or a digital input; a machine without it is refused. */
#define TANDEM_SIGNAL(name) {sizeof(tandem_input), 1, name, sizeof(name) - 1, 0, 0, 0, UINT32_MAX}
/* The same where the script can do without. */
#define TANDEM_OPTIONAL_SIGNAL(name) {sizeof(tandem_input), 1, name, sizeof(name) - 1, 0, 0, 1, UINT32_MAX}
/* An axis, by its letter; a machine without it is refused. */
#define TANDEM_AXIS(name) {sizeof(tandem_input), 2, name, sizeof(name) - 1, 0, 0, 0, UINT32_MAX}
/* The same where the script can do without. */
#define TANDEM_OPTIONAL_AXIS(name) {sizeof(tandem_input), 2, name, sizeof(name) - 1, 0, 0, 1, UINT32_MAX}

static tandem_input *tandem_inputs;
static uint32_t tandem_input_count;
/* Names the inputs, an array of tandem_input, before TANDEM_POLICY. */
#define TANDEM_INPUTS(inputs)                  \
  static tandem_input *tandem_inputs = inputs; \
  static uint32_t tandem_input_count = sizeof(inputs) / sizeof((inputs)[0]);

/* What the program has stated of an input; NaN where nothing is in force. */
static inline double tandem_program(const tandem_block *block, const tandem_input *input) {
  return input->place < 8 ? block->program[input->place] : __builtin_nan("");
}
/* A signal; NaN where nothing was heard of it. */
static inline double tandem_signal(const tandem_period *period, const tandem_input *input) {
  return input->place < 16 ? period->signals[input->place] : __builtin_nan("");
}
/* The entry of an axis in any array of eight; NaN where the machine has no such axis. */
static inline double tandem_axis(const double *values, const tandem_input *axis) {
  return axis->place < 8 ? values[axis->place] : __builtin_nan("");
}

#define TANDEM_LAYOUT(parameters, count, state, bytes)                                                                 \
  static tandem_block tandem_window[64];                                                                               \
  static tandem_period tandem_means;                                                                                   \
  static tandem_layout tandem_said;                                                                                    \
  TANDEM_EXPORT("tandem_policy_v2") tandem_layout *tandem_policy_v2(void) {                                            \
    tandem_said = (tandem_layout){sizeof(tandem_layout), sizeof(tandem_block), tandem_window,            64,           \
                                  sizeof(tandem_period), &tandem_means,        sizeof(tandem_parameter), parameters,   \
                                  count,                 0,                    state,                    bytes,        \
                                  tandem_inputs,         sizeof(tandem_input), tandem_input_count,       0};           \
    return &tandem_said;                                                                                               \
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
