/* topo: what the machine offers this process. hwloc appears in topo.c alone. */
#ifndef WH_EXEC_TOPO_H
#define WH_EXEC_TOPO_H

#include <stddef.h>

/* Bytes of memory this process may use: the least of the machine's memory, the limit of its
 * control group and the Slurm job's share ($SLURM_MEM_PER_NODE). */
size_t wh_topo_memory(void);

#endif
