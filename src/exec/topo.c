#define _GNU_SOURCE
#include "exec/topo.h"

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#ifdef WH_HAVE_HWLOC
#include <hwloc.h>
#endif

static uint64_t machine_memory(void)
{
	uint64_t bytes = 0;
#ifdef WH_HAVE_HWLOC
	hwloc_topology_t t;
	if (hwloc_topology_init(&t) == 0) {
		if (hwloc_topology_load(t) == 0)
			bytes = hwloc_get_root_obj(t)->total_memory;
		hwloc_topology_destroy(t);
	}
#endif
	if (bytes == 0) {
		const long pages = sysconf(_SC_PHYS_PAGES), size = sysconf(_SC_PAGESIZE);
		if (pages > 0 && size > 0)
			bytes = (uint64_t)pages * (uint64_t)size;
	}
	return bytes ? bytes : (uint64_t)1 << 30;
}

/* The number in a file of one line; 0 when there is none ("max"). */
static uint64_t number_in(const char *path)
{
	FILE *f = fopen(path, "re");
	if (!f)
		return 0;
	char line[64];
	uint64_t n = 0;
	if (fgets(line, sizeof line, f))
		n = strtoull(line, NULL, 10);
	(void)fclose(f);
	return n;
}

/* Limit of the process's own control group (version 2), or of version 1's memory controller. */
static uint64_t group_memory(void)
{
	uint64_t least = 0;
	FILE *f = fopen("/proc/self/cgroup", "re");
	char line[512], path[640];
	while (f && fgets(line, sizeof line, f)) {
		line[strcspn(line, "\n")] = '\0';
		if (strncmp(line, "0::", 3) == 0)
			(void)snprintf(path, sizeof path, "/sys/fs/cgroup%s/memory.max", line + 3);
		else if (strstr(line, ":memory:"))
			(void)snprintf(path, sizeof path,
			               "/sys/fs/cgroup/memory%s/memory.limit_in_bytes",
			               strrchr(line, ':') + 1);
		else
			continue;
		const uint64_t n = number_in(path);
		if (n && (least == 0 || n < least))
			least = n;
	}
	if (f)
		(void)fclose(f);
	const uint64_t root = number_in("/sys/fs/cgroup/memory.max");
	return root && (least == 0 || root < least) ? root : least;
}

/* The job's memory on this node, in MiB. */
static uint64_t slurm_memory(void)
{
	const char *mib = getenv("SLURM_MEM_PER_NODE"); /* NOLINT(concurrency-mt-unsafe) */
	return mib ? strtoull(mib, NULL, 10) << 20 : 0;
}

size_t wh_topo_memory(void)
{
	uint64_t bytes = machine_memory();
	const uint64_t limits[2] = {group_memory(), slurm_memory()};
	for (int i = 0; i < 2; i++)
		if (limits[i] && limits[i] < bytes)
			bytes = limits[i];
	return (size_t)bytes;
}
